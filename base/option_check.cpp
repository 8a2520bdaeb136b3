#include "base/option_check.hpp"

#include <sstream>

namespace twofold {
namespace {

std::string text(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

}  // namespace

OptionCheck& OptionCheck::at_least(std::string_view field, double value, double least) {
  return that(value >= least, field, ">= " + text(least), value);
}

OptionCheck& OptionCheck::above(std::string_view field, double value, double bound) {
  return that(value > bound, field, "> " + text(bound), value);
}

OptionCheck& OptionCheck::within(std::string_view field, double value, double least, double most) {
  return that(value >= least && value <= most, field, "in [" + text(least) + ", " + text(most) + "]", value);
}

OptionCheck& OptionCheck::share(std::string_view field, double value) {
  return that(value > 0 && value <= 1, field, "in (0, 1]", value);
}

OptionCheck& OptionCheck::that(bool holds, std::string_view field, std::string_view rule, double value) {
  if (!holds && reason_.empty()) {
    reason_ = std::string(field).append(" must be ").append(rule).append(", is ").append(text(value));
  }
  return *this;
}

OptionCheck& OptionCheck::rule(bool holds, std::string_view sentence) {
  if (!holds && reason_.empty()) reason_ = sentence;
  return *this;
}

OptionCheck& OptionCheck::nested(std::string_view field, const std::string& reason) {
  if (!reason.empty() && reason_.empty()) reason_ = std::string(field).append(".").append(reason);
  return *this;
}

}  // namespace twofold
