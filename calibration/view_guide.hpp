#pragma once

#include <string>

#include "calibration/view_shape.hpp"

namespace twofold {

struct ViewGuideOptions {
  int wanted_views = 20;         ///< >= 3
  int max_views = 60;            ///< more are thinned out, >= wanted_views
  double wanted_coverage = 0.8;  ///< share of the image's cells with a corner, in [0, 1]
  double wanted_tilt = 0.3;      ///< in each of four directions [rad] >= 0
  double wanted_zoom = 1.5;      ///< largest over smallest view, >= 1
  double novelty = 0.03;         ///< rms distance of corners from every chosen view [image diagonals] >= 0,
                                 ///< or ...
  double novelty_angle = 0.25;   ///< ... another tilt than every chosen view that is nearer [rad] >= 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Chooses views for a calibration and says what is still missing, in words for the person who holds the
/// board. Looks at one camera (the left one of a pair).
class ViewGuide {
 public:
  ViewGuide(const Board& board, cv::Size size, const ViewGuideOptions& options = {});

  /// True: the view differs from all chosen before and is chosen; its index is the number offered so far.
  bool offer(const BoardView& view);

  /// Numbers of the offers that stand (0 is the first), ascending.
  [[nodiscard]] const std::vector<int>& chosen() const { return chosen_; }
  [[nodiscard]] double coverage() const;
  /// What to do next, most important first; empty when nothing is missing.
  [[nodiscard]] std::vector<std::string> missing() const;

 private:
  struct Entry {
    BoardView view;
    ViewShape shape;
  };
  [[nodiscard]] bool is_new(const Entry& entry, const std::vector<Entry>& others) const;
  void thin_out();

  Board board_;
  cv::Size size_;
  ViewGuideOptions options_;
  double novelty_px_, novelty_angle_;
  int offered_ = 0;
  std::vector<int> chosen_;
  std::vector<Entry> entries_;  // one a chosen view
};

}  // namespace twofold
