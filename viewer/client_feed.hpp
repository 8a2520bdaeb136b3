#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "twofold/viewer.hpp"
#include "viewer/texts.hpp"

namespace twofold {

struct ViewMessage {
  std::shared_ptr<const std::string> bytes;
  bool text = false;
};

/// A message of a kind of which only the newest matters; null: none yet.
struct NewestMessage {
  std::uint64_t number = 0;
  std::shared_ptr<const std::string> bytes = nullptr;

  void put(std::string message) {
    bytes = std::make_shared<const std::string>(std::move(message));
    ++number;
  }
};

/// What the camera sees: an image, and what was measured in one; and what it saw at the keyframe that
/// somebody asked for last.
struct ViewSight {
  NewestMessage image, measured;
  std::uint32_t keyframe = kNoId;
  NewestMessage keyframe_image = {};
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
  [[nodiscard]] std::optional<ViewMessage> next(const ViewSight& sight);
  using Time = std::chrono::steady_clock::time_point;
  static constexpr int kMessagesASecond =
      500;  // beside acknowledgements, of which there are no more than messages
  /// A message of the client (wire_format.hpp). False: nonsense, or more than it may, and the client is to
  /// go.
  [[nodiscard]] bool take(std::string_view message, Time now = {});
  /// What the client asked for since the last call, each command once, in the order of the last wishes.
  [[nodiscard]] std::vector<ViewCommand> take_commands() { return std::exchange(commands_, {}); }

  [[nodiscard]] bool wants_images() const { return wants_images_; }
  /// The keyframe whose image the client waits for; it waits for one at a time.
  [[nodiscard]] std::optional<std::uint32_t> wanted_keyframe() const { return wanted_keyframe_; }
  /// The scene will not change any more, and why: told at once, before what the client still lacks.
  void end(std::string message) { last_words_ = std::move(message); }
  /// That was handed out, and everything there is.
  [[nodiscard]] bool is_done() const;

 private:
  [[nodiscard]] std::optional<ViewMessage> next_text();
  [[nodiscard]] std::optional<ViewMessage> newer(const NewestMessage& newest, std::uint64_t& sent) const;
  [[nodiscard]] std::shared_ptr<const std::string> next_frames();
  [[nodiscard]] std::shared_ptr<const std::string> next_piece();
  [[nodiscard]] std::shared_ptr<const std::string> next_surface();

  const ViewScene& scene_;
  const ViewTitle& title_;
  bool greeted_ = false;
  std::uint32_t truths_ = 0;  // known to the client
  std::uint32_t states_ = 0;  // likewise
  std::size_t reasons_ = 1;   // known to the client
  std::uint64_t event_ = 0;
  std::uint64_t live_ = 0;
  Revision revision_ = 0, next_revision_ = 0;  // what it has, and has when the delta is through
  std::shared_ptr<const ViewScene::Delta> delta_;
  std::size_t piece_ = 0;                   // of delta_, to be sent next
  std::uint64_t surface_ = 0;               // change that the client knows
  std::uint64_t image_ = 0, measured_ = 0;  // numbers of those sent last
  bool wants_images_ = false;
  bool asked_ = false;  // whether anybody is there: any message is an answer
  std::optional<std::uint32_t> wanted_keyframe_;
  std::vector<ViewCommand> commands_;  // at most one of a kind
  std::optional<std::string> last_words_;
  bool told_end_ = false;
  int unacknowledged_ = 0;
  Time second_began_;
  int messages_ = 0;  // in this second
};

}  // namespace twofold
