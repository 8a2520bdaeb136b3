#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/files/io_error.hpp"

namespace twofold {

/// The images of a recording that cannot be read. One damaged file, as a disk or a download leaves it, is a
/// gap in the recording; many in a row are a recording that cannot be used.
class DamagedImages {
 public:
  static constexpr int kMostInARow = 10;
  static constexpr std::size_t kMostLines = 20;

  /// One more in a row is left out because of `error`. Throws it after kMostInARow others.
  void leave_out(const IoError& error);
  /// The row ends: a frame was read.
  void frame_was_read();
  /// Throws the last error when the recording ends and no frame was read.
  void expect_any_frame() const;

  [[nodiscard]] std::uint64_t count() const { return count_; }
  /// A line for each of the first kMostLines.
  [[nodiscard]] const std::vector<std::string>& lines() const { return lines_; }

 private:
  int in_a_row_ = 0;
  bool any_frame_ = false;
  std::uint64_t count_ = 0;
  std::vector<std::string> lines_;
  std::string last_;
};

}  // namespace twofold
