#include "io/files/image_pairs.hpp"

#include <algorithm>
#include <compare>
#include <cstdlib>
#include <map>
#include <string>

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr const char* kDigits = "0123456789";

using Names = std::vector<std::string>;

Names stems(const std::vector<fs::path>& files) {
  Names names;
  for (const fs::path& file : files) names.push_back(file.stem().string());
  return names;
}

/// The numbers in a name, without zeros before them: 007 and 7 are the same.
std::vector<std::string> numbers_in(const std::string& name) {
  std::vector<std::string> numbers;
  for (std::size_t begin = name.find_first_of(kDigits); begin != std::string::npos;) {
    const std::size_t end = std::min(name.find_first_not_of(kDigits, begin), name.size());
    std::string digits = name.substr(begin, end - begin);
    digits.erase(0, std::min(digits.find_first_not_of('0'), digits.size() - 1));
    numbers.push_back(std::move(digits));
    begin = name.find_first_of(kDigits, end);
  }
  return numbers;
}

/// Of each name the numbers in which the names differ: the 1 of cam1_00042 says which camera it is, not which
/// image. Empty for names without such numbers.
Names counting_numbers(const Names& names) {
  std::vector<std::vector<std::string>> all;
  for (const std::string& name : names) all.push_back(numbers_in(name));
  const auto same_everywhere = [&](std::size_t place) {
    return std::all_of(all.begin(), all.end(), [&](const auto& numbers) {
      return numbers.size() == all[0].size() && numbers[place] == all[0][place];
    });
  };
  std::vector<bool> shared;
  for (std::size_t place = 0; !all.empty() && place < all[0].size(); ++place)
    shared.push_back(same_everywhere(place));
  Names keys;
  for (const auto& numbers : all) {
    std::string key;
    for (std::size_t place = 0; place < numbers.size(); ++place)
      if (place >= shared.size() || !shared[place]) key += numbers[place] + " ";
    keys.push_back(std::move(key));
  }
  return keys;
}

/// Places of equal keys. Empty when a key stands twice on a side, or when chance may have made the pairs.
ImagePairs pairs_of_equal(const Names& left, const Names& right) {
  const auto places_of = [](const Names& keys) {
    std::map<std::string, std::size_t> places;
    for (std::size_t i = 0; i < keys.size(); ++i) places.emplace(keys[i], i);
    return places;
  };
  const auto places = places_of(right);
  if (places.size() < right.size() || places_of(left).size() < left.size()) return {};
  ImagePairs pairs;
  for (std::size_t i = 0; i < left.size(); ++i) {
    const auto partner = places.find(left[i]);
    if (!left[i].empty() && partner != places.end()) pairs.emplace_back(i, partner->second);
  }
  return 2 * pairs.size() >= std::min(left.size(), right.size()) ? pairs : ImagePairs();
}

/// A left and a right image without another image of either side between them in time.
struct Neighbours {
  std::int64_t gap_ns = 0;
  std::size_t left = 0, right = 0;
  friend auto operator<=>(const Neighbours&, const Neighbours&) = default;
};

/// Those not farther apart than max_gap_ns, closest first; of equal ones the earlier. No others need be
/// looked at: with a second left image between the two, the right one is closer to that, and the other way
/// round.
std::vector<Neighbours> neighbours_in_time(const std::vector<StampedFile>& left,
                                           const std::vector<StampedFile>& right, std::int64_t max_gap_ns) {
  std::vector<Neighbours> neighbours;
  std::size_t l = 0, r = 0;
  while (l < left.size() && r < right.size()) {
    const std::int64_t gap_ns = right[r].t_ns - left[l].t_ns;
    const bool next_left = l + 1 < left.size() && left[l + 1].t_ns <= right[r].t_ns;
    const bool next_right = r + 1 < right.size() && right[r + 1].t_ns <= left[l].t_ns;
    if (!next_left && !next_right && std::abs(gap_ns) <= max_gap_ns)
      neighbours.push_back({std::abs(gap_ns), l, r});
    ++(gap_ns >= 0 ? l : r);
  }
  std::sort(neighbours.begin(), neighbours.end());
  return neighbours;
}

}  // namespace

ImagePairs pairs_by_name(const std::vector<fs::path>& left, const std::vector<fs::path>& right) {
  const Names left_stems = stems(left), right_stems = stems(right);
  ImagePairs pairs = pairs_of_equal(left_stems, right_stems);
  if (!pairs.empty()) return pairs;
  return pairs_of_equal(counting_numbers(left_stems), counting_numbers(right_stems));
}

ImagePairs pairs_by_time(const std::vector<StampedFile>& left, const std::vector<StampedFile>& right,
                         std::int64_t max_gap_ns) {
  const std::vector<Neighbours> neighbours = neighbours_in_time(left, right, max_gap_ns);
  std::vector<bool> left_taken(left.size()), right_taken(right.size());
  ImagePairs pairs;
  for (const auto& [gap_ns, l, r] : neighbours) {
    if (left_taken[l] || right_taken[r]) continue;
    left_taken[l] = right_taken[r] = true;
    pairs.emplace_back(l, r);
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace twofold
