#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace twofold {

struct TextLine {
  int number = 0;  ///< counts from 1
  std::string text;
  bool ended = true;  ///< by a line end; false: the file's last, which may have been cut
};

/// Lines of a text file that are neither blank nor comments ('#' first), without line ends, blanks before
/// those and a byte order mark. Throws IoError when the file cannot be read, or is UTF-16.
[[nodiscard]] std::vector<TextLine> read_text_lines(const std::filesystem::path& file);
/// The same of a table, without a heading: a first line that names the columns, none of which is a number.
[[nodiscard]] std::vector<TextLine> read_table_lines(const std::filesystem::path& file);

/// Non-empty pieces of `text` between any of the separators; views into it.
[[nodiscard]] std::vector<std::string_view> split_fields(std::string_view text,
                                                         std::string_view separators = " \t");

/// The whole text as a finite decimal number, independent of the locale.
[[nodiscard]] std::optional<double> to_number(std::string_view text);
[[nodiscard]] std::optional<std::int64_t> to_integer(std::string_view text);

/// Of time stamps in files.
enum class TimeUnit : std::uint8_t { kSeconds, kMilliseconds, kMicroseconds, kNanoseconds };
/// "seconds", ...
[[nodiscard]] const char* name_of(TimeUnit unit);

/// A time as decimal text to nanoseconds: exact for plain decimals (no detour over double, which is off by
/// up to 120 ns for today's Unix times); digits below 1 ns are dropped. Also reads 1.036e-01. Nothing when
/// negative, or after the year 2255.
[[nodiscard]] std::optional<std::int64_t> time_to_ns(std::string_view text, TimeUnit unit);
[[nodiscard]] std::optional<std::int64_t> seconds_to_ns(std::string_view text);

/// The inverse, with nine decimals.
[[nodiscard]] std::string ns_to_seconds(std::int64_t t_ns);

/// As above for a field of a file's line; throw IoError naming file, line and field.
[[nodiscard]] double number_field(const std::filesystem::path& file, int line, std::string_view field);
/// Seconds, or nanoseconds where the number is too large for all other units, as ORB-SLAM3 writes EuRoC's.
[[nodiscard]] std::int64_t seconds_field(const std::filesystem::path& file, int line, std::string_view field);
/// A whole number; zeros behind a decimal point may follow.
[[nodiscard]] std::int64_t nanoseconds_field(const std::filesystem::path& file, int line,
                                             std::string_view field);

/// Throws IoError unless t_ns is after previous_t_ns; previous_t_ns is then t_ns. Start it with -1.
void expect_increasing(const std::filesystem::path& file, int line, std::int64_t t_ns,
                       std::int64_t* previous_t_ns);

}  // namespace twofold
