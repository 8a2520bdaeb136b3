#include "io/files/output_file.hpp"

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "io/files/io_error.hpp"

namespace twofold {
namespace {

std::string why_not() {
  return std::string("cannot be written: ") + std::strerror(errno != 0 ? errno : EIO);
}

}  // namespace

OutputFile::OutputFile(std::filesystem::path file) : file_(std::move(file)) {
  errno = 0;
  stream_.open(file_, std::ios::binary | std::ios::trunc);
  if (!stream_) throw IoError(file_, why_not());
}

void OutputFile::close() {
  stream_.close();  // a full disk may only show when the last buffer is flushed
  if (!stream_) throw WriteError(file_, why_not());
}

void write_file(const std::filesystem::path& file, std::string_view content) {
  OutputFile output(file);
  output.write(content);
  output.close();
}

void prepare_output_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error && !std::filesystem::is_directory(folder)) {
    throw IoError(folder, "the output folder cannot be made: " + error.message());
  }
  if (!std::filesystem::is_directory(folder)) throw IoError(folder, "is in the way of the output folder");
  const auto probe = folder / ".twofold-write-test";
  write_file(probe, "x");
  std::filesystem::remove(probe, error);
}

}  // namespace twofold
