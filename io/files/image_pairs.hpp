#pragma once

#include <cstdint>
#include <filesystem>
#include <utility>
#include <vector>

namespace twofold {

/// Places in two lists of images that belong together, in order; each place is used once at most.
using ImagePairs = std::vector<std::pair<std::size_t, std::size_t>>;

/// Pairs the image files of two cameras, in the order of `left`, by what their names have in common: the
/// whole stem, else the numbers that count the images (left_007.png and right_007.png, frame-000007.color.png
/// and frame-000007.depth.png; a number that all names of a side share counts nothing). Empty when the names
/// say nothing: fewer than half of the shorter list's have a partner, or two images of a side have the same.
[[nodiscard]] ImagePairs pairs_by_name(const std::vector<std::filesystem::path>& left,
                                       const std::vector<std::filesystem::path>& right);

struct StampedFile {
  std::int64_t t_ns = 0;
  std::filesystem::path file;
};

/// Pairs images by time, those closest to each other first, if they are no farther apart than max_gap_ns: an
/// image whose own partner is missing stays alone rather than take its neighbour's. Times increase in both
/// lists. O(n log n).
[[nodiscard]] ImagePairs pairs_by_time(const std::vector<StampedFile>& left,
                                       const std::vector<StampedFile>& right, std::int64_t max_gap_ns);

}  // namespace twofold
