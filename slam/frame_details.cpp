#include "slam/frame_details.hpp"

#include <algorithm>
#include <cmath>

#include "tracking/common/effort.hpp"
#include "tracking/common/track_result.hpp"

namespace twofold {

std::span<const std::int64_t> FrameDetails::stage_ns() const {
  return impl_->report.stage_ns;
}

QueueLengths FrameDetails::waiting() const {
  return impl_->waiting;
}

std::size_t FrameDetails::points(std::span<MeasuredPoint> found) const {
  const Rig& rig = impl_->rig;
  const PoseReport& report = impl_->report;
  if (report.record.state != FrameState::kTracked) return 0;
  const SE3 T_c_ref = report.record.T_c_ref.unpacked();
  const double level_0 = rig.information(Eigen::Vector3f::Zero(), 0)[0];
  const std::size_t count = std::min(found.size(), report.measured.size());
  for (std::size_t i = 0; i < count; ++i) {
    const MotionObservation& seen = report.measured[i];
    const Vector2 expected = rig.camera.project(T_c_ref * seen.x_ref);
    const Vector2 predicted = rig.camera.project(report.searched.T_c_ref * seen.x_ref);
    const double level_size = std::sqrt(level_0 / seen.information[0]);  // a pixel of its pyramid level
    found[i] = {seen.pixel[0],
                seen.pixel[1],
                static_cast<float>(expected.x()),
                static_cast<float>(expected.y()),
                seen.inlier ? 1U : 0U,
                static_cast<float>(predicted.x()),
                static_cast<float>(predicted.y()),
                static_cast<float>(report.searched.radius_px * level_size)};
  }
  return count;
}

std::vector<std::string> tracker_stages() {
  std::vector<std::string> names;
  for (std::size_t s = 0; s < kTrackerStages; ++s) names.emplace_back(describe(static_cast<TrackerStage>(s)));
  return names;
}

std::vector<std::string> effort_levels() {
  std::vector<std::string> words;
  for (int level = 0; level < kEffortLevels; ++level)
    words.emplace_back(describe(static_cast<EffortLevel>(level)));
  return words;
}

}  // namespace twofold
