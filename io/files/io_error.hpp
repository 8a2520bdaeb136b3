#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

namespace twofold {

/// Input that cannot be used, or an output that cannot be made; the program ends with exit code 2.
///
/// what() is one line: "FILE: what is wrong" or "FILE:LINE: what is wrong". Anything taken from the input and
/// put into the message has its control characters replaced, so that it stays one line.
class IoError : public std::runtime_error {
 public:
  /// A message that names its subject already.
  explicit IoError(const std::string& message);
  /// subject: a file, a folder or the text of a source the user gave.
  IoError(const std::filesystem::path& subject, const std::string& problem);
  IoError(const std::filesystem::path& file, int line, const std::string& problem);
};

/// An output that could be made, but not be written whole, as on a full disk: exit code 1.
class WriteError : public IoError {
 public:
  using IoError::IoError;
};

}  // namespace twofold
