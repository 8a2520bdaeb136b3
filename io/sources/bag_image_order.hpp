#pragma once

#include <cstdint>
#include <deque>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "io/bags/bag_reader.hpp"

namespace twofold {

/// One camera's image out of a bag.
struct BagImage {
  std::int64_t t_ns = 0;
  cv::Mat image;  ///< grey of 8 or 16 bits, or depth
  MessagePlace place;
};

/// Images of one camera by increasing times.
///
/// What follows tells which time is wrong: an image that is not after the one before it is; but where times
/// jumped ahead, and go on from before the jump within kConfirmed images, what lies beyond the jump is (a
/// clock that was set for a moment, damaged bytes). Until that is known these images wait. A single image
/// beyond a jump at the end is left out, too.
class BagImageOrder {
 public:
  static constexpr std::size_t kConfirmed = 3;

  /// @param interval_ns  between images, usually; 0: not known, and no time is far ahead
  explicit BagImageOrder(std::int64_t interval_ns);

  /// Appends to `in_order` what is known to be in order now.
  /// @return a line for each image that is left out, naming its time and the other one's
  [[nodiscard]] std::vector<std::string> add(BagImage image, std::deque<BagImage>& in_order);
  /// Likewise; no image follows.
  [[nodiscard]] std::vector<std::string> finish(std::deque<BagImage>& in_order);

 private:
  [[nodiscard]] bool is_far(std::int64_t t_ns) const;
  void accept_waiting(std::deque<BagImage>& in_order);

  std::int64_t far_ns_;               // a longer step is a jump; 0: none is
  std::optional<std::int64_t> last_;  // of those in order
  std::deque<BagImage> beyond_jump_;  // also the first images of all
};

}  // namespace twofold
