#include "viewer/client_feed.hpp"

#include <algorithm>

namespace twofold {
namespace {

std::shared_ptr<const std::string> shared(std::string bytes) {
  return std::make_shared<const std::string>(std::move(bytes));
}

}  // namespace

std::optional<ViewMessage> ClientFeed::next(const ViewImage& newest) {
  if (unacknowledged_ >= kUnacknowledged) return std::nullopt;
  std::optional<ViewMessage> message = next_text();
  if (!message) {
    if (auto frames = next_frames()) {
      message = ViewMessage{std::move(frames)};
    } else if (auto piece = next_piece()) {
      message = ViewMessage{std::move(piece)};
    } else if (wants_images_ && newest.message != nullptr && newest.number > image_) {
      image_ = newest.number;
      message = ViewMessage{newest.message};
    } else if (last_words_ && !ended_) {
      message = ViewMessage{shared(ended_text(*last_words_)), true};
      ended_ = true;
    }
  }
  if (message) ++unacknowledged_;
  return message;
}

std::optional<ViewMessage> ClientFeed::next_text() {
  if (!greeted_) {
    greeted_ = true;
    return ViewMessage{shared(hello_text(title_)), true};
  }
  if (reasons_ < scene_.reasons().size()) {
    reasons_ = scene_.reasons().size();
    return ViewMessage{shared(reasons_text(scene_.reasons())), true};
  }
  if (!has_truth_ && scene_.truth()) {
    has_truth_ = true;
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

bool ClientFeed::take(std::string_view message) {
  if (message == "ack") return --unacknowledged_ >= 0;
  if (message != "images on" && message != "images off") return false;
  wants_images_ = message == "images on";
  return true;
}

}  // namespace twofold
