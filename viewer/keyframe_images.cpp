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
  if (is_empty_) sight.keyframe = kNoId;  // the image may be there by now
  // The newest answer is still there for those who want the same.
  const auto next =
      std::find_if(wanted.begin(), wanted.end(), [&](std::uint32_t id) { return id != sight.keyframe; });
  if (next == wanted.end()) return;
  std::string message = image_message(ViewMessageKind::kKeyframeImage, *next, {});
  const std::size_t nothing = message.size();
  try {
    const ViewedImage found = find_(*next);  // its owner keeps the pixels until they are encoded
    message = image_message(ViewMessageKind::kKeyframeImage, *next, found.pixels);
  } catch (const std::exception&) {  // a file that is gone or broken: as good as none
  }
  is_empty_ = message.size() == nothing;
  sight.keyframe = *next;
  sight.keyframe_image.put(std::move(message));
  due_ns_ = now_ns + kPeriodNs;
}

}  // namespace twofold
