#pragma once

#include <cstdint>
#include <map>

#include "calibration/calibrate.hpp"
#include "calibration/view_guide.hpp"
#include "camera/frame.hpp"

namespace twofold {

/// Which sort of frames a collector is shown.
struct CollectorInput {
  cv::Size size;        ///< of the images
  bool stereo = false;  ///< the board has to be seen in both
  bool live = false;    ///< somebody moves the board: views are taken while it rests
};

/// How far the board moved from one view to the next: its farthest corner [px]. Single corners of a ChArUco
/// board come and go; infinite where fewer than three quarters of them are in both.
[[nodiscard]] double movement(const BoardView& before, const BoardView& now);

/// Looks for the board in one frame after the other, keeps the views a calibration needs, and tells the
/// person with the board what to do next.
class ViewCollector {
 public:
  ViewCollector(const Board& board, const CollectorInput& input, const ViewGuideOptions& options = {});

  /// The frame's images are as the camera took them, CV_8UC1 of the stated size.
  void look(const Frame& frame);

  /// Nothing is missing any more.
  [[nodiscard]] bool complete() const { return guide_.missing().empty(); }
  /// One line: how far it is and what to do next; never empty.
  [[nodiscard]] std::string progress() const;
  /// In the order in which they were taken; the right views are empty for a single camera.
  [[nodiscard]] std::vector<ViewPair> chosen() const;
  [[nodiscard]] std::int64_t frames() const { return frames_; }
  /// Frames that showed the board (to both cameras).
  [[nodiscard]] std::int64_t found() const { return found_; }

 private:
  enum class Sight : std::uint8_t { kNone, kLeftOnly, kMoving, kUsable };
  [[nodiscard]] Sight see(const Frame& frame, ViewPair* pair);

  Board board_;
  CollectorInput input_;
  ViewGuide guide_;
  std::map<int, ViewPair> chosen_;  // by the guide's number
  int offered_ = 0;
  BoardView before_;  // of the frame before; empty when the board was not seen
  Sight sight_ = Sight::kUsable;
  int same_sight_ = 0;  // frames in a row
  std::int64_t frames_ = 0, found_ = 0;
};

}  // namespace twofold
