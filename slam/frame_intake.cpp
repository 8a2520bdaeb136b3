#include "slam/frame_intake.hpp"

#include <memory>
#include <opencv2/imgproc.hpp>

#include <fmt/format.h>

namespace twofold {
namespace {

/// OpenCV counts the matrices that share the pixels and calls this when none is left.
class OwnerAllocator : public cv::MatAllocator {
 public:
  using Owner = std::shared_ptr<const void>;

  [[nodiscard]] cv::Mat wrap(const ImageView& view, int type, const Owner& owner) const {
    auto* pixels = static_cast<std::uint8_t*>(const_cast<void*>(view.data));  // the engine only reads them
    cv::Mat image(view.height, view.width, type, pixels, static_cast<std::size_t>(view.stride));
    image.u = new cv::UMatData(this);
    image.u->data = image.u->origdata = pixels;
    image.u->size = static_cast<std::size_t>(view.stride) * static_cast<std::size_t>(view.height);
    image.u->userdata = new Owner(owner);
    image.u->refcount = 1;
    image.allocator = const_cast<OwnerAllocator*>(this);
    return image;
  }

  cv::UMatData* allocate(int dims, const int* sizes, int type, void* data, std::size_t* step,
                         cv::AccessFlag flags, cv::UMatUsageFlags usage) const override {
    return cv::Mat::getStdAllocator()->allocate(dims, sizes, type, data, step, flags, usage);
  }
  bool allocate(cv::UMatData* data, cv::AccessFlag flags, cv::UMatUsageFlags usage) const override {
    return cv::Mat::getStdAllocator()->allocate(data, flags, usage);
  }
  void deallocate(cv::UMatData* data) const override {
    if (data == nullptr) return;
    delete static_cast<Owner*>(data->userdata);
    delete data;
  }
};

const char* name_of(ImageFormat format) {
  switch (format) {
    case ImageFormat::kGrey8:
      return "grey8";
    case ImageFormat::kRgb8:
      return "rgb8";
    case ImageFormat::kBgr8:
      return "bgr8";
    case ImageFormat::kDepth16:
      break;
  }
  return "depth16";
}

int type_of(ImageFormat format) {
  if (format == ImageFormat::kGrey8) return CV_8UC1;
  return format == ImageFormat::kDepth16 ? CV_16UC1 : CV_8UC3;
}

std::string image_refusal(const char* name, const ImageView& view, const PinholeCamera& camera, bool depth) {
  if (view.data == nullptr) return fmt::format("the {} image is missing", name);
  if (view.width != camera.width || view.height != camera.height)
    return fmt::format("the {} image is {}x{}, the rig's are {}x{}", name, view.width, view.height,
                       camera.width, camera.height);
  if ((view.format == ImageFormat::kDepth16) != depth)
    return fmt::format("the {} image is {}, but must be {}", name, name_of(view.format),
                       depth ? "depth16" : "grey8, rgb8 or bgr8");
  const auto row = static_cast<std::ptrdiff_t>(CV_ELEM_SIZE(type_of(view.format))) * view.width;
  if (view.stride < row)
    return fmt::format("the {} image's stride is {} bytes, but a row takes {}", name, view.stride, row);
  return "";
}

cv::Mat pixels_of(const ImageView& view, const OwnerAllocator::Owner& owner) {
  static const auto& kAllocator = *new OwnerAllocator;  // outlives every image
  if (view.data == nullptr) return {};
  const int type = type_of(view.format);
  if (owner && type != CV_8UC3) return kAllocator.wrap(view, type, owner);
  const cv::Mat theirs(view.height, view.width, type, const_cast<void*>(view.data),
                       static_cast<std::size_t>(view.stride));
  cv::Mat ours;
  if (type == CV_8UC3) {
    cv::cvtColor(theirs, ours, view.format == ImageFormat::kRgb8 ? cv::COLOR_RGB2GRAY : cv::COLOR_BGR2GRAY);
  } else {
    theirs.copyTo(ours);
  }
  return ours;
}

}  // namespace

std::string FrameIntake::refusal(const FrameView& view) const {
  if (next_index_ > 0 && view.t_ns <= last_t_ns_)
    return fmt::format("time does not grow: the frame was taken at {} ns, the one before at {} ns", view.t_ns,
                       last_t_ns_);
  if (std::string why = image_refusal("left", view.left, rig_.camera, false); !why.empty()) return why;
  if (rig_.kind == SensorKind::kRgbd) return image_refusal("depth", view.depth, rig_.camera, true);
  return image_refusal("right", view.right, rig_.camera, false);
}

Frame FrameIntake::take(const FrameView& view) {
  Frame frame;
  frame.index = next_index_;
  frame.t_ns = view.t_ns;
  frame.left = pixels_of(view.left, view.owner);
  if (rig_.kind == SensorKind::kRgbd) {
    frame.depth = pixels_of(view.depth, view.owner);
  } else {
    frame.right = pixels_of(view.right, view.owner);
  }
  skip(view);
  return frame;
}

void FrameIntake::skip(const FrameView& view) {
  ++next_index_;
  last_t_ns_ = view.t_ns;
}

}  // namespace twofold
