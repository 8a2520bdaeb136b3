#include "io/files/text_file.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <fstream>

#include <fmt/format.h>

#include "io/files/io_error.hpp"

namespace twofold {
namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;
constexpr std::int64_t kMaxSeconds = 9'000'000'000;  // below 2^63 ns
constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";

std::int64_t ns_per(TimeUnit unit) {
  switch (unit) {
    case TimeUnit::kSeconds:
      return kNsPerSecond;
    case TimeUnit::kMilliseconds:
      return 1'000'000;
    case TimeUnit::kMicroseconds:
      return 1'000;
    case TimeUnit::kNanoseconds:
      break;
  }
  return 1;
}

/// Digits behind the decimal point as nanoseconds.
std::int64_t fraction_ns(std::string_view digits, std::int64_t unit_ns) {
  std::int64_t ns = 0;
  for (const char digit : digits) ns += (digit - '0') * (unit_ns /= 10);
  return ns;
}

bool all_digits(std::string_view text) {
  return text.find_first_not_of("0123456789") == std::string_view::npos;
}

/// Numbers that are none are values, too.
bool is_value(std::string_view field) {
  if (field.starts_with('-') || field.starts_with('+')) field.remove_prefix(1);
  const auto same = [](char a, char b) { return std::tolower(static_cast<unsigned char>(a)) == b; };
  const auto is = [&](std::string_view word) {
    return std::equal(field.begin(), field.end(), word.begin(), word.end(), same);
  };
  return to_number(field).has_value() || is("nan") || is("inf");
}

bool is_heading(std::string_view line) {
  const auto fields = split_fields(line, " \t,;");
  const bool named =
      !fields.empty() && (std::isalpha(static_cast<unsigned char>(fields[0][0])) != 0 || fields[0][0] == '"');
  return named && std::none_of(fields.begin(), fields.end(), is_value);
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
    if (number == 1 && (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff")))
      throw IoError(file, "is UTF-16 text: save it as UTF-8");
    if (number == 1 && text.starts_with(kByteOrderMark)) text.erase(0, kByteOrderMark.size());
    while (!text.empty() && (text.back() == '\r' || text.back() == ' ' || text.back() == '\t'))
      text.pop_back();
    const auto first = text.find_first_not_of(" \t");
    if (first == std::string::npos || text[first] == '#') continue;
    lines.push_back({number, text, !stream.eof()});
  }
  if (stream.bad()) throw IoError(file, "cannot be read");
  return lines;
}

std::vector<TextLine> read_table_lines(const std::filesystem::path& file) {
  std::vector<TextLine> lines = read_text_lines(file);
  if (!lines.empty() && is_heading(lines.front().text)) lines.erase(lines.begin());
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

const char* name_of(TimeUnit unit) {
  switch (unit) {
    case TimeUnit::kSeconds:
      return "seconds";
    case TimeUnit::kMilliseconds:
      return "milliseconds";
    case TimeUnit::kMicroseconds:
      return "microseconds";
    case TimeUnit::kNanoseconds:
      break;
  }
  return "nanoseconds";
}

std::optional<std::int64_t> time_to_ns(std::string_view text, TimeUnit unit) {
  const std::int64_t unit_ns = ns_per(unit), most = kMaxSeconds * (kNsPerSecond / unit_ns);
  const auto dot = text.find('.');
  const std::string_view whole = text.substr(0, dot);
  const std::string_view fraction = dot == std::string_view::npos ? "" : text.substr(dot + 1);
  if (!whole.empty() && all_digits(whole) && all_digits(fraction)) {
    const auto count = to_integer(whole);
    if (!count || *count > most) return std::nullopt;
    return *count * unit_ns + fraction_ns(fraction, unit_ns);
  }
  const auto count = to_number(text);
  if (!count || *count < 0 || *count > static_cast<double>(most)) return std::nullopt;
  return std::llround(*count * static_cast<double>(unit_ns));
}

std::optional<std::int64_t> seconds_to_ns(std::string_view text) {
  return time_to_ns(text, TimeUnit::kSeconds);
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
  if (const auto t_ns = seconds_to_ns(field)) return *t_ns;
  const auto in_ns = time_to_ns(field, TimeUnit::kNanoseconds);
  if (in_ns && !time_to_ns(field, TimeUnit::kMicroseconds)) return *in_ns;
  throw IoError(file, line,
                fmt::format("'{}' is not a time stamp in seconds{}", field,
                            in_ns ? ": it is that large in milliseconds or microseconds" : ""));
}

std::int64_t nanoseconds_field(const std::filesystem::path& file, int line, std::string_view field) {
  const auto dot = field.find('.');
  const bool whole =
      dot == std::string_view::npos || field.substr(dot + 1).find_first_not_of('0') == std::string_view::npos;
  const auto t_ns = whole ? to_integer(field.substr(0, dot)) : std::nullopt;
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
