#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "viewer/texts.hpp"

namespace twofold {

struct ViewMessage {
  std::shared_ptr<const std::string> bytes;
  bool text = false;
};

/// The image that is newest, as a whole message; null: none.
struct ViewImage {
  std::uint64_t number = 0;  ///< grows
  std::shared_ptr<const std::string> message;
};

/// What one client is to get next. Nothing waits in a queue: each message is made when the one before has
/// gone, of what is newest then. The page acknowledges what it has dealt with; while kUnacknowledged messages
/// are under way it gets nothing, so that a page that is slow, or reads nothing, holds a bounded amount of
/// memory.
///
/// One thread. The scene outlives the feed.
class ClientFeed {
 public:
  static constexpr int kUnacknowledged = 8;

  ClientFeed(const ViewScene& scene, const ViewTitle& title) : scene_(scene), title_(title) {}

  /// Nothing: the client is up to date, or has enough to do.
  [[nodiscard]] std::optional<ViewMessage> next(const ViewImage& newest);
  /// A message of the client: "ack", "images on", "images off". False: nonsense, and the client is to go.
  [[nodiscard]] bool take(std::string_view message);

  [[nodiscard]] bool wants_images() const { return wants_images_; }
  /// Nothing more will come, and why; the last message.
  void end(std::string message) { last_words_ = std::move(message); }
  /// The last message was handed out.
  [[nodiscard]] bool has_ended() const { return ended_; }

 private:
  [[nodiscard]] std::optional<ViewMessage> next_text();
  [[nodiscard]] std::shared_ptr<const std::string> next_frames();
  [[nodiscard]] std::shared_ptr<const std::string> next_piece();

  const ViewScene& scene_;
  const ViewTitle& title_;
  bool greeted_ = false, has_truth_ = false;
  std::size_t reasons_ = 1;  // known to the client
  std::uint64_t event_ = 0;
  std::uint64_t live_ = 0;
  Revision revision_ = 0, next_revision_ = 0;  // what it has, and has when the delta is through
  std::shared_ptr<const ViewScene::Delta> delta_;
  std::size_t piece_ = 0;  // of delta_, to be sent next
  std::uint64_t image_ = 0;
  bool wants_images_ = false;
  std::optional<std::string> last_words_;
  bool ended_ = false;
  int unacknowledged_ = 0;
};

}  // namespace twofold
