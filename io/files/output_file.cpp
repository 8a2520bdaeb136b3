#include "io/files/output_file.hpp"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <string>

#include "io/files/io_error.hpp"

namespace twofold {

void write_file(const std::filesystem::path& file, std::string_view content) {
  errno = 0;
  std::ofstream stream(file, std::ios::binary | std::ios::trunc);
  stream.write(content.data(), static_cast<std::streamsize>(content.size()));
  stream.close();  // a full disk may only show when the last buffer is flushed
  if (!stream)
    throw IoError(file, std::string("cannot be written: ") + std::strerror(errno != 0 ? errno : EIO));
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
