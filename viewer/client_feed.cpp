#include "viewer/client_feed.hpp"

#include <algorithm>
#include <array>
#include <charconv>

namespace twofold {
namespace {

std::shared_ptr<const std::string> shared(std::string bytes) {
  return std::make_shared<const std::string>(std::move(bytes));
}

constexpr std::array<std::pair<std::string_view, ViewCommand>, 4> kCommands{
    {{"save map", ViewCommand::kSaveMap},
     {"stop", ViewCommand::kStop},
     {"pause mapping", ViewCommand::kPauseMapping},
     {"resume mapping", ViewCommand::kResumeMapping}}};

/// Of "keyframe 17": digits and nothing else.
std::optional<std::uint32_t> keyframe_of(std::string_view message) {
  constexpr std::string_view kWord = "keyframe ";
  if (!message.starts_with(kWord)) return std::nullopt;
  message.remove_prefix(kWord.size());
  std::uint32_t id = 0;
  const auto [end, error] = std::from_chars(message.data(), message.data() + message.size(), id);
  if (error != std::errc() || end != message.data() + message.size() || id == kNoId) return std::nullopt;
  return id;
}

}  // namespace

std::optional<ViewMessage> ClientFeed::next(const ViewSight& sight) {
  if (greeted_ && last_words_ && !told_end_) {
    told_end_ = true;  // whatever else is under way: the words are few, and there are no more of them
    ++unacknowledged_;
    return ViewMessage{shared(ended_text(*last_words_)), true};
  }
  if (unacknowledged_ >= kUnacknowledged) return std::nullopt;
  std::optional<ViewMessage> message = next_text();
  if (!message && wanted_keyframe_ && sight.keyframe == *wanted_keyframe_ && sight.keyframe_image.bytes) {
    wanted_keyframe_.reset();
    message = ViewMessage{sight.keyframe_image.bytes};
  }
  if (!message) message = newer(sight.measured, measured_);
  if (!message) {
    if (auto frames = next_frames()) {
      message = ViewMessage{std::move(frames)};
    } else if (auto piece = next_piece()) {
      message = ViewMessage{std::move(piece)};
    } else {
      message = newer(sight.image, image_);
    }
  }
  if (!message) {
    if (auto surface = next_surface()) message = ViewMessage{std::move(surface)};
  }
  if (message) ++unacknowledged_;
  return message;
}

std::optional<ViewMessage> ClientFeed::newer(const NewestMessage& newest, std::uint64_t& sent) const {
  if (!wants_images_ || newest.number == sent) return std::nullopt;
  sent = newest.number;
  return ViewMessage{newest.bytes};
}

bool ClientFeed::is_done() const {
  return told_end_ && event_ == scene_.end_event() && live_ == scene_.end_live() && !delta_ &&
         revision_ == scene_.revision() && surface_ == scene_.surface().newest();
}

std::optional<ViewMessage> ClientFeed::next_text() {
  if (!greeted_) {
    greeted_ = true;
    return ViewMessage{shared(hello_text(title_)), true};
  }
  if (std::exchange(asked_, false)) return ViewMessage{shared("{}"), true};
  if (states_ < scene_.states()) {
    states_ = scene_.states();
    return ViewMessage{shared(state_text(scene_)), true};
  }
  if (reasons_ < scene_.reasons().size()) {
    reasons_ = scene_.reasons().size();
    return ViewMessage{shared(reasons_text(scene_.reasons())), true};
  }
  if (truths_ < scene_.truths()) {
    truths_ = scene_.truths();
    return ViewMessage{shared(truth_text(*scene_.truth())), true};
  }
  if (event_ < scene_.end_event()) {
    const std::uint64_t begin = std::exchange(event_, scene_.end_event());
    return ViewMessage{shared(events_text(scene_, begin)), true};
  }
  return std::nullopt;
}

std::shared_ptr<const std::string> ClientFeed::next_frames() {
  if (live_ == scene_.end_live()) return nullptr;
  const std::uint64_t begin = std::max(live_, scene_.first_live());
  live_ = scene_.end_live();
  const ViewMessageHeader header{ViewMessageKind::kFrames, static_cast<std::uint32_t>(live_ - begin)};
  std::string bytes(reinterpret_cast<const char*>(&header), sizeof header);
  for (std::uint64_t n = begin; n < live_; ++n)
    bytes.append(reinterpret_cast<const char*>(&scene_.live(n)), sizeof(ViewLiveFrame));
  return shared(std::move(bytes));
}

std::shared_ptr<const std::string> ClientFeed::next_piece() {
  if (!delta_) {
    if (revision_ == scene_.revision()) return nullptr;
    delta_ = scene_.delta(revision_);
    next_revision_ = scene_.revision();
    piece_ = 0;
  }
  auto piece = (*delta_)[piece_++];
  if (piece_ == delta_->size()) {
    delta_.reset();
    revision_ = next_revision_;
  }
  return piece;
}

/// A piece at a time, after all else: a mesh is much, and late as it is.
std::shared_ptr<const std::string> ClientFeed::next_surface() {
  if (surface_ == scene_.surface().newest()) return nullptr;
  const SurfaceLayer::Message message = scene_.surface().next(surface_);
  surface_ = message.to;
  return message.bytes;
}

bool ClientFeed::take(std::string_view message, Time now) {
  if (message == "ack") return --unacknowledged_ >= 0;
  if (now - second_began_ > std::chrono::seconds(1)) {
    second_began_ = now;
    messages_ = 0;
  }
  if (++messages_ > kMessagesASecond) return false;
  if (message == "still there?") {
    asked_ = true;
    return true;
  }
  if (message == "images on" || message == "images off") {
    wants_images_ = message == "images on";
    return true;
  }
  if (const auto keyframe = keyframe_of(message); keyframe && title_.keyframe_images) {
    wanted_keyframe_ = keyframe;
    return true;
  }
  const auto command = std::find_if(kCommands.begin(), kCommands.end(),
                                    [&](const auto& known) { return known.first == message; });
  if (!title_.control || command == kCommands.end()) return false;
  // Of two that undo each other the later one counts, in its turn.
  std::erase(commands_, command->second);
  commands_.push_back(command->second);
  return true;
}

}  // namespace twofold
