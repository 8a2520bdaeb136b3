#include "io/files/text_file.hpp"

#include <charconv>
#include <cmath>
#include <fstream>

#include <fmt/format.h>

#include "io/files/io_error.hpp"

namespace twofold {
namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;
constexpr std::int64_t kMaxSeconds = 9'000'000'000;  // below 2^63 ns

/// Digits of the fraction as nanoseconds.
std::int64_t fraction_ns(std::string_view digits) {
  std::int64_t ns = 0;
  for (std::size_t i = 0; i < 9; ++i) ns = 10 * ns + (i < digits.size() ? digits[i] - '0' : 0);
  return ns;
}

bool all_digits(std::string_view text) {
  return text.find_first_not_of("0123456789") == std::string_view::npos;
}

}  // namespace

std::vector<TextLine> read_text_lines(const std::filesystem::path& file) {
  std::error_code ignored;
  if (!std::filesystem::exists(file, ignored)) throw IoError(file, "no such file");
  std::ifstream stream(file);
  if (!stream || std::filesystem::is_directory(file, ignored)) throw IoError(file, "cannot be opened");
  std::vector<TextLine> lines;
  std::string text;
  for (int number = 1; std::getline(stream, text); ++number) {
    while (!text.empty() && (text.back() == '\r' || text.back() == ' ' || text.back() == '\t'))
      text.pop_back();
    const auto first = text.find_first_not_of(" \t");
    if (first == std::string::npos || text[first] == '#') continue;
    lines.push_back({number, text, !stream.eof()});
  }
  if (stream.bad()) throw IoError(file, "cannot be read");
  return lines;
}

std::vector<std::string_view> split_fields(std::string_view text, std::string_view separators) {
  std::vector<std::string_view> fields;
  for (std::size_t begin = text.find_first_not_of(separators); begin != std::string_view::npos;) {
    const std::size_t end = std::min(text.find_first_of(separators, begin), text.size());
    fields.push_back(text.substr(begin, end - begin));
    begin = text.find_first_not_of(separators, end);
  }
  return fields;
}

std::optional<double> to_number(std::string_view text) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<std::int64_t> to_integer(std::string_view text) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<std::int64_t> seconds_to_ns(std::string_view text) {
  const auto dot = text.find('.');
  const std::string_view whole = text.substr(0, dot);
  const std::string_view fraction = dot == std::string_view::npos ? "" : text.substr(dot + 1);
  if (!whole.empty() && all_digits(whole) && all_digits(fraction)) {
    const auto seconds = to_integer(whole);
    if (!seconds || *seconds > kMaxSeconds) return std::nullopt;
    return *seconds * kNsPerSecond + fraction_ns(fraction);
  }
  const auto seconds = to_number(text);
  if (!seconds || *seconds < 0 || *seconds > static_cast<double>(kMaxSeconds)) return std::nullopt;
  return std::llround(*seconds * 1e9);
}

std::string ns_to_seconds(std::int64_t t_ns) {
  return fmt::format("{}.{:09d}", t_ns / kNsPerSecond, t_ns % kNsPerSecond);
}

double number_field(const std::filesystem::path& file, int line, std::string_view field) {
  const auto value = to_number(field);
  if (!value) throw IoError(file, line, fmt::format("'{}' is not a finite number", field));
  return *value;
}

std::int64_t seconds_field(const std::filesystem::path& file, int line, std::string_view field) {
  const auto t_ns = seconds_to_ns(field);
  if (!t_ns) throw IoError(file, line, fmt::format("'{}' is not a time stamp in seconds", field));
  return *t_ns;
}

std::int64_t nanoseconds_field(const std::filesystem::path& file, int line, std::string_view field) {
  const auto t_ns = to_integer(field);
  if (!t_ns || *t_ns < 0)
    throw IoError(file, line, fmt::format("'{}' is not a time stamp in nanoseconds", field));
  return *t_ns;
}

void expect_increasing(const std::filesystem::path& file, int line, std::int64_t t_ns,
                       std::int64_t* previous_t_ns) {
  if (t_ns <= *previous_t_ns) {
    throw IoError(file, line,
                  fmt::format("time stamp {} is {} the one before it", ns_to_seconds(t_ns),
                              t_ns == *previous_t_ns ? "the same as" : "earlier than"));
  }
  *previous_t_ns = t_ns;
}

}  // namespace twofold
