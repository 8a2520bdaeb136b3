#include "io/sources/layouts/numbered_frames.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "io/files/calibration_file.hpp"
#include "io/files/io_error.hpp"
#include "io/files/text_file.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

/// Nothing: the name has another form.
std::optional<std::int64_t> number_in_name(std::string_view name, std::string_view before,
                                           std::initializer_list<std::string_view> after) {
  constexpr std::size_t kMostDigits = 9;
  if (!name.starts_with(before)) return std::nullopt;
  name.remove_prefix(before.size());
  const std::size_t digits = std::min(name.find_first_not_of("0123456789"), name.size());
  if (digits == 0 || digits > kMostDigits) return std::nullopt;
  if (std::find(after.begin(), after.end(), name.substr(digits)) == after.end()) return std::nullopt;
  return to_integer(name.substr(0, digits));
}

fs::directory_iterator entries_of(const fs::path& folder) {
  std::error_code error;
  fs::directory_iterator entries(folder, error);
  if (error) throw IoError(folder, "no such folder, or it cannot be read");
  return entries;
}

[[noreturn]] void refuse_alone(const NumberedFile& image, const char* others) {
  throw IoError(image.file,
                fmt::format("no {} image has its number (unpaired=drop keeps the pairs)", others));
}

}  // namespace

std::vector<NumberedFile> list_numbered(const fs::path& folder, std::string_view before,
                                        std::initializer_list<std::string_view> after) {
  std::vector<NumberedFile> files;
  for (const auto& entry : entries_of(folder))
    if (const auto number = number_in_name(entry.path().filename().string(), before, after))
      files.push_back({*number, entry.path()});
  std::sort(files.begin(), files.end(), [](const NumberedFile& a, const NumberedFile& b) {
    return std::pair(a.number, a.file) < std::pair(b.number, b.file);
  });
  for (std::size_t i = 1; i < files.size(); ++i)
    if (files[i].number == files[i - 1].number)
      throw IoError(files[i].file,
                    fmt::format("has the same number as {}", files[i - 1].file.filename().string()));
  return files;
}

bool has_numbered(const fs::path& folder, std::string_view before,
                  std::initializer_list<std::string_view> after) {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored))
    if (number_in_name(entry.path().filename().string(), before, after)) return true;
  return false;
}

double take_numbered_fps(double usual, SourceParameters& parameters) {
  return parameters.take_positive("fps").value_or(usual);
}

std::int64_t time_of_number(const NumberedFile& file, double fps) {
  const double t_ns = static_cast<double>(file.number) / fps * 1e9;
  constexpr double kLatest = 9e18;  // of 64 bits
  if (!(t_ns < kLatest))
    throw IoError(file.file, fmt::format("at {} frames a second: beyond all times", fps));
  return std::llround(t_ns);
}

void take_numbered_frames(const std::vector<NumberedFile>& colour, const std::vector<NumberedFile>& depth,
                          double fps, SourceParameters& parameters, Recording* recording) {
  const bool drop_unpaired = parameters.take_drop_unpaired();
  auto partner = depth.begin();
  for (const NumberedFile& image : colour) {
    if (parameters.left_only()) {
      recording->frames.push_back({time_of_number(image, fps), image.file, {}, {}});
      continue;
    }
    for (; partner != depth.end() && partner->number < image.number; ++partner, ++recording->alone)
      if (!drop_unpaired) refuse_alone(*partner, "colour");
    if (partner != depth.end() && partner->number == image.number) {
      recording->frames.push_back({time_of_number(image, fps), image.file, {}, partner++->file});
      continue;
    }
    if (!drop_unpaired) refuse_alone(image, "depth");
    ++recording->alone;
  }
  if (parameters.left_only()) return;
  if (partner != depth.end() && !drop_unpaired) refuse_alone(*partner, "colour");
  recording->alone += static_cast<std::uint64_t>(depth.end() - partner);
}

void take_numbered_calibration(const std::optional<fs::path>& given,
                               const std::function<std::optional<Calibration>()>& otherwise,
                               double usual_depth_unit, SourceParameters& parameters, Recording* recording) {
  const fs::path beside = recording->folder / "calibration.yaml";
  std::optional<Calibration> found;
  recording->calibration_file = parameters.subject();
  if (given || fs::exists(beside)) {
    recording->calibration_file = given.value_or(beside);
    found = read_calibration(recording->calibration_file);
  } else if (!parameters.has_intrinsics()) {
    found = otherwise();
  }
  const bool from_file = found.has_value();
  Calibration base = std::move(found).value_or(Calibration());
  if (!base.depth_unit_stated) base.depth_unit = usual_depth_unit;
  recording->calibration = with_parameters(std::move(base), from_file, SensorKind::kRgbd, parameters);
}

}  // namespace twofold
