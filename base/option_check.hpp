#pragma once

#include <string>
#include <string_view>

namespace twofold {

/// Says why options are invalid: the first rule that does not hold, as "inner_window must be >= 1, is 0". NaN
/// keeps no rule.
///
///   return OptionCheck().at_least("patience", patience, 1).share("early", early).reason();
class OptionCheck {
 public:
  OptionCheck& at_least(std::string_view field, double value, double least);
  OptionCheck& above(std::string_view field, double value, double bound);
  /// In [least, most].
  OptionCheck& within(std::string_view field, double value, double least, double most);
  /// In (0, 1].
  OptionCheck& share(std::string_view field, double value);
  /// Any other rule, in words after "must be".
  OptionCheck& that(bool holds, std::string_view field, std::string_view rule, double value);
  /// A rule about options of which a number says nothing: `sentence` is what is wrong, when it does not hold.
  OptionCheck& rule(bool holds, std::string_view sentence);
  /// Options within these: `reason` is why they are invalid, if they are.
  OptionCheck& nested(std::string_view field, const std::string& reason);

  /// Empty when every rule holds.
  [[nodiscard]] const std::string& reason() const { return reason_; }

 private:
  std::string reason_;
};

}  // namespace twofold
