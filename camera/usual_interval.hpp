#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace twofold {

/// The usual interval between the frames of a stream: the median of the last nine intervals, so that neither
/// a pause, nor frames that are missing, nor two that came close together make it what it is not.
class UsualInterval {
 public:
  /// Time stamp of the next frame. Bounded work, no allocation.
  void add(std::int64_t t_ns) {
    if (last_t_ns_ && t_ns > *last_t_ns_) intervals_[count_++ % intervals_.size()] = t_ns - *last_t_ns_;
    last_t_ns_ = t_ns;
  }

  /// [ns]; 0 before the second frame.
  [[nodiscard]] std::int64_t ns() const {
    const std::size_t known = std::min(count_, intervals_.size());
    if (known == 0) return 0;
    auto sorted = intervals_;
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>((known - 1) / 2);
    std::nth_element(sorted.begin(), middle, sorted.begin() + static_cast<std::ptrdiff_t>(known));
    return *middle;
  }

 private:
  std::array<std::int64_t, 9> intervals_{};  // a ring
  std::size_t count_ = 0;                    // intervals so far
  std::optional<std::int64_t> last_t_ns_;
};

}  // namespace twofold
