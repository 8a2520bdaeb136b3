#include "twofold/source.hpp"

#include <array>
#include <atomic>
#include <map>
#include <mutex>
#include <stdexcept>

#include "io/sources/open_source.hpp"
#include "slam/conversions.hpp"
#include "slam/frame_pixels.hpp"

namespace twofold {

struct TWOFOLD_HIDDEN Source::Impl {
  Impl(const std::string& name, const SourceSettings& settings) {
    SourceOptions options;
    options.preload = settings.preload;
    options.left_only = settings.left_only;
    options.stop = &stop;
    if (!settings.calibration.empty()) options.calibration = settings.calibration;
    source = open_source(name, options);
    rig = to_camera_rig(source->rig());
    for (const TimedPose& pose : source->ground_truth()) truth.push_back({pose.t_ns, to_pose(pose.T_w_c)});
  }

  std::atomic<bool> stop{false};  // relaxed: it carries nothing else
  std::mutex frames;              // guards the source's frames: who asks for one has his turn
  std::unique_ptr<FrameSource> source;
  CameraRig rig;
  std::vector<StampedPose> truth;
  std::map<std::int64_t, std::int64_t> index_at;  // of a recording's frames, by their times
};

Source::Source(const std::string& name, const SourceSettings& settings)
    : impl_(std::make_unique<Impl>(name, settings)) {}
Source::~Source() = default;
Source::Source(Source&&) noexcept = default;
Source& Source::operator=(Source&&) noexcept = default;

const CameraRig& Source::rig() const {
  return impl_->rig;
}

Pose Source::T_rectified_raw() const {
  return to_pose(SE3(impl_->source->R_rectified_raw(), Vector3::Zero()));
}

std::optional<std::int64_t> Source::frame_count() const {
  return impl_->source->frame_count();
}

bool Source::is_live() const {
  return impl_->source->is_live();
}

const std::vector<StampedPose>& Source::ground_truth() const {
  return impl_->truth;
}

bool Source::next(FrameView& view) {
  const std::scoped_lock turn(impl_->frames);
  Frame frame;
  if (impl_->stop.load(std::memory_order_relaxed)) return false;
  switch (impl_->source->next(frame)) {
    case FrameStatus::kFrame:
      break;
    case FrameStatus::kEnd:
      return false;
    case FrameStatus::kError:
      throw std::runtime_error(impl_->source->error());
  }
  if (!impl_->source->is_live()) impl_->index_at.emplace(frame.t_ns, frame.index);
  view = view_of(impl_->rig.sensor, frame);
  return true;
}

FrameView Source::in_colour(const FrameView& frame) const {
  std::int64_t index = -1;
  {
    const std::scoped_lock turn(impl_->frames);
    const auto at = impl_->index_at.find(frame.t_ns);
    if (at == impl_->index_at.end()) return frame;
    index = at->second;
  }
  return with_colour(frame, impl_->source->colour_image(index));
}

void Source::stop() {
  impl_->stop.store(true, std::memory_order_relaxed);
}

}  // namespace twofold
