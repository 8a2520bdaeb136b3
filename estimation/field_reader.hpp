#pragma once

#include <charconv>
#include <iosfwd>
#include <string>
#include <string_view>
#include <vector>

namespace twofold {

/// Reads text files of numbers, line by line, and knows where it is: every error is a std::runtime_error
/// "name:line: what is wrong". Fields are separated by blanks; empty lines, and what follows a '#', are
/// skipped.
class FieldReader {
 public:
  FieldReader(std::istream& in, std::string name) : in_(in), name_(std::move(name)) {}

  /// Goes to the next line, which must have `count` fields; `what` it should be is for the error text.
  void next(std::size_t count, const char* what);
  /// True when only empty lines are left.
  [[nodiscard]] bool at_end();

  /// The next field of the line.
  [[nodiscard]] std::string_view word() { return fields_[at_++]; }
  template <class Number>
  [[nodiscard]] Number number() {
    const std::string_view field = word();
    Number value{};
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    if (error != std::errc() || end != field.data() + field.size()) {
      fail(std::string("'").append(field).append("' is not a number"));
    }
    return value;
  }
  /// A whole number that can be a count of something in memory.
  [[nodiscard]] int count();

  [[noreturn]] void fail(const std::string& what) const;

 private:
  bool advance();

  std::istream& in_;
  std::string name_;
  std::string text_;
  std::vector<std::string_view> fields_;  // of text_
  std::size_t at_ = 0;
  int line_ = 0;
  bool pending_ = false;  // text_ was read ahead by at_end
};

}  // namespace twofold
