#include "estimation/field_reader.hpp"

#include <algorithm>
#include <istream>
#include <stdexcept>

namespace twofold {

/// Reads on to the next line that has fields.
bool FieldReader::advance() {
  if (pending_) return true;
  do {
    if (!std::getline(in_, text_)) return false;
    ++line_;
    fields_.clear();
    const std::string_view all = std::string_view(text_).substr(0, text_.find('#'));
    for (std::size_t begin = 0; (begin = all.find_first_not_of(" \t\r", begin)) != all.npos;) {
      const std::size_t end = std::min(all.find_first_of(" \t\r", begin), all.size());
      fields_.push_back(all.substr(begin, end - begin));
      begin = end;
    }
  } while (fields_.empty());
  return true;
}

void FieldReader::next(std::size_t count, const char* what) {
  if (!advance()) fail(std::string("file ends where ") + what + " should stand");
  pending_ = false;
  at_ = 0;
  if (fields_.size() != count) {
    fail(std::string(what) + " needs " + std::to_string(count) + " fields, found " +
         std::to_string(fields_.size()));
  }
}

bool FieldReader::at_end() {
  pending_ = advance();
  return !pending_;
}

int FieldReader::count() {
  constexpr int kMaxCount = 100'000'000;  // above this the file is broken
  const int value = number<int>();
  if (value < 0 || value > kMaxCount) {
    fail(std::string("count ").append(std::to_string(value)).append(" is out of range"));
  }
  return value;
}

void FieldReader::fail(const std::string& what) const {
  throw std::runtime_error(name_ + ":" + std::to_string(line_) + ": " + what);
}

}  // namespace twofold
