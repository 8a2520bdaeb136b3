#include "viewer/keyframe_images.hpp"

#include <algorithm>
#include <exception>

#include "viewer/image_message.hpp"

namespace twofold {
namespace {

constexpr std::int64_t kPeriodNs = 250'000'000;

}  // namespace

void KeyframeImages::answer(std::span<const std::uint32_t> wanted, std::int64_t now_ns, ViewSight& sight) {
  if (!find_ || now_ns < due_ns_) return;
  // The newest answer is still there for those who want the same.
  const auto next =
      std::find_if(wanted.begin(), wanted.end(), [&](std::uint32_t id) { return id != sight.keyframe; });
  if (next == wanted.end()) return;
  ViewedImage image;
  try {
    image = find_(*next);
  } catch (const std::exception&) {  // a file that is gone or broken: as good as none
  }
  sight.keyframe = *next;
  sight.keyframe_image.put(image_message(ViewMessageKind::kKeyframeImage, *next, image.pixels));
  due_ns_ = now_ns + kPeriodNs;
}

}  // namespace twofold
