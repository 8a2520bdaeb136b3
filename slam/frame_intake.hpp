#pragma once

#include <string>

#include "camera/frame.hpp"
#include "camera/rig.hpp"
#include "twofold/types.hpp"

namespace twofold {

/// Checks frames that come from outside, and makes the engine's frames of them.
class FrameIntake {
 public:
  explicit FrameIntake(const Rig& rig) : rig_(rig) {}

  /// Empty when the frame can be used; else one sentence that says what is wrong.
  [[nodiscard]] std::string refusal(const FrameView& view) const;
  /// Of a frame that is not refused. It gets the next number. Grey images and depth in units stay where they
  /// are if the view has an owner, which the frame then keeps; else they are copied.
  [[nodiscard]] Frame take(const FrameView& view);
  /// A frame that could be used but found no room: its number, which no other frame gets, and its time has
  /// passed.
  std::int64_t skip(const FrameView& view);

 private:
  Rig rig_;
  std::int64_t next_index_ = 0;
  std::int64_t last_t_ns_ = 0;  // of no meaning before the first frame
};

}  // namespace twofold
