#pragma once

#include <cstdint>
#include <limits>
#include <optional>

namespace twofold {

/// Errors of pairing two cameras by their time stamps.
struct PairingReport {
  std::uint64_t pairs = 0;
  std::uint64_t left_alone = 0;   ///< frames of the left camera without a partner
  std::uint64_t right_alone = 0;  ///< likewise
  double sum_error_ns = 0;        ///< of |t_right - t_left| over pairs
  std::int64_t max_error_ns = 0;

  [[nodiscard]] double mean_error_ms() const {
    return pairs == 0 ? 0 : sum_error_ns / static_cast<double>(pairs) * 1e-6;
  }
};

enum class PairingStep : std::uint8_t { kPair, kAdvanceLeft, kAdvanceRight };

/// Merges two increasing sequences of time stamps: frames no further apart than the tolerance are a pair;
/// otherwise the earlier one can have no partner any more, because all to come are later still. With a
/// tolerance of at most half a frame interval no frame is closer to another than to its partner. Who can wait
/// for the frame after the earlier one, as a recording's reader can, need not know the interval.
class FramePairer {
 public:
  explicit FramePairer(std::int64_t tolerance_ns) : tolerance_ns_(tolerance_ns) {}

  /// @param t_next_ns  the frame after the earlier of the two, where it is known: no pair is made when that
  /// is
  ///                   nearer to the later one
  [[nodiscard]] PairingStep step(std::int64_t t_left_ns, std::int64_t t_right_ns,
                                 std::optional<std::int64_t> t_next_ns = std::nullopt) {
    const std::int64_t error_ns = t_right_ns - t_left_ns;
    const std::int64_t magnitude_ns = error_ns < 0 ? -error_ns : error_ns;
    const std::int64_t later_ns = error_ns > 0 ? t_right_ns : t_left_ns;
    const bool next_is_nearer =
        t_next_ns && (*t_next_ns > later_ns ? *t_next_ns - later_ns : later_ns - *t_next_ns) < magnitude_ns;
    if (magnitude_ns > tolerance_ns_ || next_is_nearer) {
      ++(error_ns > 0 ? report_.left_alone : report_.right_alone);
      return error_ns > 0 ? PairingStep::kAdvanceLeft : PairingStep::kAdvanceRight;
    }
    ++report_.pairs;
    report_.sum_error_ns += static_cast<double>(magnitude_ns);
    if (magnitude_ns > report_.max_error_ns) report_.max_error_ns = magnitude_ns;
    return PairingStep::kPair;
  }
  /// Whether the two are a pair unless the frame after the earlier one is nearer to the later one.
  [[nodiscard]] bool depends_on_next(std::int64_t t_left_ns, std::int64_t t_right_ns) const {
    const std::int64_t error_ns = t_right_ns - t_left_ns;
    return error_ns != 0 && (error_ns < 0 ? -error_ns : error_ns) <= tolerance_ns_;
  }
  [[nodiscard]] const PairingReport& report() const { return report_; }

 private:
  std::int64_t tolerance_ns_;
  PairingReport report_;
};

}  // namespace twofold
