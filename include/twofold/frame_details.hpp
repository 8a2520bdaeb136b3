#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "twofold/queue_lengths.hpp"
#include "twofold/types.hpp"

namespace twofold {

/// A point of the map as it was found in an image.
struct MeasuredPoint {
  float u = 0, v = 0;        ///< measured [px]
  float expected_u = 0;      ///< where the pose puts it [px]
  float expected_v = 0;      ///< likewise
  std::uint32_t inlier = 1;  ///< 0: put aside as an outlier
  // Where it was searched: a square around the prediction.
  float predicted_u = 0;  ///< [px]
  float predicted_v = 0;  ///< [px]
  float radius = 0;       ///< half of its side [px]; 0: not known
};

/// What the tracker did for a frame (Slam::on_frame): valid during that call only.
class TWOFOLD_API FrameDetails {
 public:
  /// What each of tracker_stages() took.
  [[nodiscard]] std::span<const std::int64_t> stage_ns() const;
  /// What waits for the engine's threads now.
  [[nodiscard]] QueueLengths waiting() const;
  /// What the pose rests on, outliers included, as far as there is room for it; found when it is asked for.
  /// No lock, no allocation.
  /// @return  how many there are in `found`
  [[nodiscard]] std::size_t points(std::span<MeasuredPoint> found) const;

  struct Impl;
  explicit FrameDetails(const Impl& impl) : impl_(&impl) {}

 private:
  const Impl* impl_;
};

/// Names of FrameDetails::stage_ns.
[[nodiscard]] TWOFOLD_API std::vector<std::string> tracker_stages();
/// Words of PoseEstimate::effort, from 0 on.
[[nodiscard]] TWOFOLD_API std::vector<std::string> effort_levels();

}  // namespace twofold
