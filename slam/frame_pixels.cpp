#include "slam/frame_pixels.hpp"

#include <opencv2/imgproc.hpp>
#include <utility>

#include <fmt/format.h>

#include "camera/metric_depth.hpp"
#include "twofold/opencv.hpp"

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
    case ImageFormat::kDepth32F:
      return "depth32f";
    case ImageFormat::kDepth16:
      break;
  }
  return "depth16";
}

int type_of(ImageFormat format) {
  switch (format) {
    case ImageFormat::kGrey8:
      return CV_8UC1;
    case ImageFormat::kDepth16:
      return CV_16UC1;
    case ImageFormat::kDepth32F:
      return CV_32FC1;
    case ImageFormat::kRgb8:
    case ImageFormat::kBgr8:
      break;
  }
  return CV_8UC3;
}

bool is_depth(ImageFormat format) {
  return format == ImageFormat::kDepth16 || format == ImageFormat::kDepth32F;
}

}  // namespace

std::string pixels_refusal(const char* name, const ImageView& view, bool depth) {
  if (view.data == nullptr) return fmt::format("the {} image is missing", name);
  if (view.width <= 0 || view.height <= 0)
    return fmt::format("the {} image is {}x{}", name, view.width, view.height);
  if (is_depth(view.format) != depth)
    return fmt::format("the {} image is {}, but must be {}", name, name_of(view.format),
                       depth ? "depth16 or depth32f" : "grey8, rgb8 or bgr8");
  const auto pixel = static_cast<std::ptrdiff_t>(CV_ELEM_SIZE(type_of(view.format)));
  const std::ptrdiff_t row = pixel * view.width;
  if (view.stride < row)
    return fmt::format("the {} image's stride is {} bytes, but a row takes {}", name, view.stride, row);
  if (depth && (view.stride % pixel != 0 ||
                reinterpret_cast<std::intptr_t>(view.data) % static_cast<std::intptr_t>(pixel) != 0))
    return fmt::format("the {} image's rows must begin at addresses divisible by {}, the bytes of a pixel",
                       name, pixel);
  return "";
}

std::string pair_refusal(const FrameView& view) {
  if (view.left.format == view.right.format) return "";
  return fmt::format("the left image is {}, the right one {}: both must be of one format",
                     name_of(view.left.format), name_of(view.right.format));
}

cv::Mat pixels_of(const ImageView& view, const std::shared_ptr<const void>& owner) {
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

cv::Mat depth_pixels_of(const ImageView& view, const std::shared_ptr<const void>& owner, double unit) {
  if (view.data == nullptr || view.format != ImageFormat::kDepth32F) return pixels_of(view, owner);
  const cv::Mat metres(view.height, view.width, CV_32FC1, const_cast<void*>(view.data),
                       static_cast<std::size_t>(view.stride));
  return in_depth_units(metres, unit);
}

cv::Mat bgr_pixels_of(const ImageView& view) {
  const cv::Mat theirs(view.height, view.width, CV_8UC3, const_cast<void*>(view.data),
                       static_cast<std::size_t>(view.stride));
  cv::Mat ours;
  if (view.format == ImageFormat::kRgb8)
    cv::cvtColor(theirs, ours, cv::COLOR_RGB2BGR);
  else
    theirs.copyTo(ours);
  return ours;
}

FrameView view_of(Sensor sensor, const Frame& frame) {
  switch (sensor) {
    case Sensor::kStereo:
      return stereo_frame(frame.t_ns, frame.left, frame.right);
    case Sensor::kRgbd:
      return rgbd_frame(frame.t_ns, frame.left, frame.depth);
    case Sensor::kMono:
      break;
  }
  return mono_frame(frame.t_ns, frame.left);
}

FrameView with_colour(const FrameView& frame, const cv::Mat& left) {
  if (left.empty()) return frame;
  FrameView coloured = frame;
  coloured.left = view(left);
  coloured.owner = std::make_shared<const std::pair<cv::Mat, std::shared_ptr<const void>>>(left, frame.owner);
  return coloured;
}

}  // namespace twofold
