#include "apps/twofold/surface/object_source.hpp"

#include <fmt/format.h>

#include "base/check.hpp"
#include "base/option_check.hpp"
#include "io/files/io_error.hpp"
#include "surface/stereo/stereo_depth.hpp"

namespace twofold {
namespace {

constexpr int kPatience = 150;  // frames of a source that may show no object before the first that does

}  // namespace

std::string ObjectSourceOptions::invalid_reason() const {
  return OptionCheck()
      .nested("mask", mask.invalid_reason())
      .above("nearest_stereo", nearest_stereo, 0)
      .at_least("keep_every", keep_every, 1)
      .reason();
}

ObjectSource::ObjectSource(std::unique_ptr<FrameSource> source, const ObjectSourceOptions& options)
    : source_(std::move(source)),
      options_(options),
      masker_(source_->rig(), options.mask),
      colours_(*source_) {
  TWOFOLD_CHECK(options.invalid_reason().empty(), "object source options");
  rig_ = source_->rig();
  R_rectified_raw_ = source_->R_rectified_raw();
  ground_truth_ = source_->ground_truth();
}

bool ObjectSource::read(Frame& frame) {
  for (;;) {
    switch (source_->next(frame)) {
      case FrameStatus::kFrame:
        break;
      case FrameStatus::kEnd:
        return false;
      case FrameStatus::kError:
        throw IoError(source_->error());
    }
    if (mask(frame)) return true;
    if (shown_ == 0 && without_object_ == kPatience) throw IoError(nothing_shown());
  }
}

bool ObjectSource::mask(Frame& frame) {
  cv::Mat depth = frame.depth;
  if (rig_.kind == SensorKind::kStereo)
    depth = stereo_depth(rig_, frame.left, frame.right, options_.nearest_stereo);
  const auto found = masker_.mask(depth);
  if (!found) {
    ++without_object_;
    reason_ = found.error();
    return false;
  }
  cut_off_ += reaches_border(*found, options_.mask.erode);
  cv::Mat object(depth.size(), CV_16UC1, cv::Scalar(0));
  depth.copyTo(object, *found);
  if (shown_++ % options_.keep_every == 0) keep(frame, object);
  frame.left = fill_outside(frame.left, *found);
  if (rig_.kind == SensorKind::kStereo) {
    frame.right = fill_outside(frame.right, mask_in_right(rig_, *found, depth));
  } else {
    frame.depth = object;
  }
  return true;
}

void ObjectSource::keep(const Frame& frame, const cv::Mat& depth) {
  if (kept_bytes_ > options_.max_bytes) {
    ++not_kept_;
    return;
  }
  Kept kept{frame.t_ns, masker_.up(), pack_keyframe_depth(frame.index, depth, colours_.left_image(frame))};
  kept_bytes_ += kept.images.depth.bytes() + kept.images.colour.bytes();
  kept_.push_back(std::move(kept));
}

std::vector<std::string> ObjectSource::left_out() const {
  std::vector<std::string> all;
  if (without_object_ > 0) all.push_back(fmt::format("{} frames: {}", without_object_, reason_));
  if (not_kept_ > 0)
    all.push_back(fmt::format("the depth of {} frames, beyond {} MiB: raise --every", not_kept_,
                              options_.max_bytes >> 20));
  colours_.add_left_out(all);
  return all;
}

double ObjectSource::share_cut_off() const {
  return shown_ > 0 ? static_cast<double>(cut_off_) / shown_ : 0;
}

std::string ObjectSource::nothing_shown() const {
  if (shown_ > 0) return {};
  if (reason_.empty()) return "no frame shows an object: there is none";
  const bool is_all = without_object_ < kPatience;
  const char* const hint = options_.mask.held ? "" : " (--held: of a thing that is held by hand)";
  return (is_all ? "no frame shows an object: "
                 : fmt::format("none of the first {} frames shows an object: ", kPatience)) +
         reason_ + hint;
}

}  // namespace twofold
