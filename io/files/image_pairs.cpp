#include "io/files/image_pairs.hpp"

#include <algorithm>
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

}  // namespace

ImagePairs pairs_by_name(const std::vector<fs::path>& left, const std::vector<fs::path>& right) {
  const Names left_stems = stems(left), right_stems = stems(right);
  ImagePairs pairs = pairs_of_equal(left_stems, right_stems);
  if (!pairs.empty()) return pairs;
  return pairs_of_equal(counting_numbers(left_stems), counting_numbers(right_stems));
}

ImagePairs pairs_by_time(const std::vector<StampedFile>& left, const std::vector<StampedFile>& right,
                         std::int64_t max_gap_ns) {
  ImagePairs pairs;
  std::size_t next = 0;
  for (std::size_t i = 0; i < left.size(); ++i) {
    const auto difference = [&](std::size_t j) { return std::abs(right[j].t_ns - left[i].t_ns); };
    while (next + 1 < right.size() && difference(next + 1) <= difference(next)) ++next;
    if (next == right.size()) break;
    if (difference(next) > max_gap_ns) continue;
    pairs.emplace_back(i, next);
    ++next;
  }
  return pairs;
}

}  // namespace twofold
