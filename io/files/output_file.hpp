#pragma once

#include <filesystem>
#include <fstream>
#include <string_view>

namespace twofold {

/// A file that is written piece by piece: what is too long to be put together in memory. All throw as
/// write_file.
class OutputFile {
 public:
  explicit OutputFile(std::filesystem::path file);
  void write(std::string_view piece) {
    stream_.write(piece.data(), static_cast<std::streamsize>(piece.size()));
  }
  /// After the last piece: whether all of it is there only shows now.
  void close();

 private:
  std::filesystem::path file_;
  std::ofstream stream_;
};

/// Writes a whole file. Throws IoError when it cannot be opened, WriteError when not all of it could be
/// written (disk full).
void write_file(const std::filesystem::path& file, std::string_view content);

/// Makes sure the folder exists and files can be written in it; throws IoError. Call it before a long run,
/// not after.
void prepare_output_folder(const std::filesystem::path& folder);

}  // namespace twofold
