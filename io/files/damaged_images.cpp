#include "io/files/damaged_images.hpp"

#include <fmt/format.h>

namespace twofold {

void DamagedImages::leave_out(const IoError& error) {
  if (++in_a_row_ > kMostInARow) throw error;
  ++count_;
  last_ = error.what();
  if (lines_.size() < kMostLines) lines_.push_back(fmt::format("{}; its frame is left out", last_));
}

void DamagedImages::frame_was_read() {
  in_a_row_ = 0;
  any_frame_ = true;
}

void DamagedImages::expect_any_frame() const {
  if (!any_frame_ && count_ > 0) throw IoError(last_);
}

}  // namespace twofold
