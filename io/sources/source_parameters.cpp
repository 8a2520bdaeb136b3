#include "io/sources/source_parameters.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include "io/files/io_error.hpp"
#include "io/files/text_file.hpp"

namespace twofold {
namespace {

bool is_scheme(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
  });
}

void parse_query(const std::string& query, SourceSpec* spec) {
  for (const std::string_view item : split_fields(query, "&")) {
    const auto equals = item.find('=');
    if (equals == std::string_view::npos || equals == 0) {
      throw IoError(spec->text, fmt::format("parameter '{}' is not of the form key=value", item));
    }
    const std::string key(item.substr(0, equals));
    if (!spec->parameters.emplace(key, item.substr(equals + 1)).second) {
      throw IoError(spec->text, fmt::format("parameter '{}' is given twice", key));
    }
  }
}

}  // namespace

SourceSpec parse_source_spec(const std::string& text) {
  SourceSpec spec;
  spec.text = text;
  std::error_code ignored;
  if (std::filesystem::exists(text, ignored)) {
    spec.argument = text;
    return spec;
  }
  std::string rest = text;
  if (const auto colon = text.find(':'); colon != std::string::npos && is_scheme(text.substr(0, colon))) {
    spec.scheme = text.substr(0, colon);
    rest = text.substr(colon + 1);
  }
  // With the scheme stripped the rest may be a path that itself contains a question mark.
  if (const auto mark = rest.rfind('?');
      mark != std::string::npos && !std::filesystem::exists(rest, ignored)) {
    parse_query(rest.substr(mark + 1), &spec);
    rest.resize(mark);
  }
  if (rest.empty()) throw IoError(text.empty() ? "source" : text, "names no folder, file or scene");
  spec.argument = rest;
  return spec;
}

std::optional<std::string> SourceParameters::take_text(const std::string& key) {
  const auto it = values_.find(key);
  if (it == values_.end()) return std::nullopt;
  std::string value = it->second;
  values_.erase(it);
  return value;
}

std::optional<double> SourceParameters::take_number(const std::string& key) {
  const auto text = take_text(key);
  if (!text) return std::nullopt;
  const auto number = to_number(*text);
  if (!number) throw IoError(subject_, fmt::format("parameter {}='{}' is not a number", key, *text));
  return number;
}

std::optional<double> SourceParameters::take_positive(const std::string& key) {
  const auto number = take_number(key);
  if (number && *number <= 0) throw IoError(subject_, fmt::format("{}={} must be positive", key, *number));
  return number;
}

bool SourceParameters::take_drop_unpaired() {
  const auto unpaired = take_text("unpaired");
  if (unpaired && *unpaired != "drop")
    throw IoError(subject_, fmt::format("parameter unpaired='{}' can only be 'drop'", *unpaired));
  return unpaired.has_value();
}

std::int64_t SourceParameters::take_max_gap_ns(double otherwise) {
  const double gap = take_number("max_gap").value_or(otherwise);
  if (gap < 0 || gap > 1) throw IoError(subject_, "max_gap must be from 0 to 1 s");
  return std::llround(gap * 1e9);
}

std::optional<std::int64_t> SourceParameters::take_count(const std::string& key, std::int64_t least) {
  const auto text = take_text(key);
  if (!text) return std::nullopt;
  const auto count = to_integer(*text);
  if (!count || *count < least)
    throw IoError(subject_,
                  fmt::format("parameter {}='{}' is not a whole number from {} on", key, *text, least));
  return count;
}

FrameRange SourceParameters::take_range() {
  FrameRange range;
  range.first = take_count("first", 0).value_or(range.first);
  range.most = take_count("frames", 1).value_or(range.most);
  return range;
}

void FrameRange::expect_within(const std::string& subject, std::int64_t count) const {
  if (first == 0 || first < count) return;
  throw IoError(subject,
                fmt::format("first={}: the recording has {} frames, which count from 0", first, count));
}

void SourceParameters::expect_all_taken() const {
  if (values_.empty()) return;
  throw IoError(subject_, fmt::format("unknown parameter '{}'", values_.begin()->first));
}

}  // namespace twofold
