#pragma once

#include <cstdint>

namespace twofold {

/// When the viewer looks for what is new: a little after the tracker has told a frame, and evenly until the
/// next. On few cores what it then does is over before the camera brings another frame; at any other time it
/// would take caches, and a core of those that share one, from the tracker at work.
class LookTimes {
 public:
  /// @param frame  its number; those that were left out count
  /// @param t_ns   when it was told
  void add_frame(std::int64_t frame, std::int64_t t_ns);

  /// The next look, if one was at `now_ns`: `period_ns` later or so, in step with the frames if they come.
  [[nodiscard]] std::int64_t next(std::int64_t now_ns, std::int64_t period_ns) const;

 private:
  std::int64_t frame_ = -1;
  std::int64_t told_ns_ = 0;
  std::int64_t interval_ns_ = 0;  ///< between two frames, on average; 0: not known
  std::int64_t averaged_ = 0;     ///< frames of which it is the average
};

}  // namespace twofold
