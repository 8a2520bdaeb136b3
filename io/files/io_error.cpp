#include "io/files/io_error.hpp"

#include <fmt/format.h>

namespace twofold {
namespace {

std::string one_line(std::string text) {
  constexpr std::size_t kMaxLength = 1000;
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  }
  if (text.size() > kMaxLength) text.replace(kMaxLength, std::string::npos, "...");
  return text;
}

}  // namespace

IoError::IoError(const std::string& message) : std::runtime_error(one_line(message)) {}

IoError::IoError(const std::filesystem::path& subject, const std::string& problem)
    : std::runtime_error(one_line(fmt::format("{}: {}", subject.string(), problem))) {}

IoError::IoError(const std::filesystem::path& file, int line, const std::string& problem)
    : std::runtime_error(one_line(fmt::format("{}:{}: {}", file.string(), line, problem))) {}

}  // namespace twofold
