#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "viewer/client_feed.hpp"

namespace twofold {

/// Answers those who clicked a keyframe with its image: four a second at most, whoever asks how often.
class KeyframeImages {
 public:
  /// The image of a keyframe; without pixels if there is none. May throw.
  using Find = std::function<ViewedImage(std::uint32_t keyframe)>;

  /// @param find  empty: there are no images
  explicit KeyframeImages(Find find) : find_(std::move(find)) {}

  /// @param wanted  what viewers wait for, each for one; of several, each gets its turn
  void answer(std::span<const std::uint32_t> wanted, std::int64_t now_ns, ViewSight& sight);

 private:
  const Find find_;
  std::int64_t due_ns_ = 0;
  bool is_empty_ = false;  // the newest answer: it is not given to those who ask later
};

}  // namespace twofold
