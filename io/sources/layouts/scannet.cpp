#include <cmath>

#include <fmt/format.h>

#include "io/files/image_file.hpp"
#include "io/files/io_error.hpp"
#include "io/files/text_file.hpp"
#include "io/files/trajectory_file.hpp"
#include "io/sources/layouts/numbered_frames.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr double kScanNetFps = 30;

/// K, three by three or, with a row and a column of the unit matrix, four by four.
PinholeCamera read_intrinsic_matrix(const fs::path& file) {
  std::vector<double> values;
  for (const TextLine& line : read_text_lines(file))
    for (const std::string_view field : split_fields(line.text))
      values.push_back(number_field(file, line.number, field));
  if (values.size() != 9 && values.size() != 16)
    throw IoError(file, fmt::format("has {} numbers, a matrix of intrinsics 9 or 16", values.size()));
  const std::size_t columns = values.size() == 9 ? 3 : 4;
  return {values[0], values[columns + 1], values[2], values[columns + 2], 0, 0};
}

/// The camera of images of this size. Who shrinks images when exporting them leaves the matrix as it was,
/// which says nothing of a size, but has its principal point in the middle.
PinholeCamera camera_of(const fs::path& file, const cv::Mat& image) {
  PinholeCamera camera = read_intrinsic_matrix(file);
  camera.width = image.cols;
  camera.height = image.rows;
  constexpr double kOffCentre = 0.2;  // of half the image
  if (std::abs(2 * camera.cx / image.cols - 1) > kOffCentre ||
      std::abs(2 * camera.cy / image.rows - 1) > kOffCentre)
    throw IoError(
        file, fmt::format("is of images about {:.0f}x{:.0f} large, but they are {}x{}: give --calib or fx, "
                          "fy, cx, cy",
                          2 * camera.cx, 2 * camera.cy, image.cols, image.rows));
  return camera;
}

/// Both cameras look from the same place, says ScanNet; what says otherwise is of something else.
void expect_one_place(const fs::path& folder) {
  for (const char* name : {"extrinsic_color.txt", "extrinsic_depth.txt"}) {
    const fs::path file = folder / name;
    if (!fs::exists(file)) continue;
    const auto T = read_pose_matrix(file);
    constexpr double kSmall = 1e-4;
    if (!T || T->log().norm() > kSmall)
      throw IoError(file, "is not the unit matrix: give --calib with a depth camera of its own");
  }
}

Calibration read_two_cameras(const fs::path& folder, const fs::path& colour, const fs::path& depth) {
  Calibration calibration;
  calibration.left.pinhole = camera_of(folder / "intrinsic_color.txt", read_grey_image(colour));
  if (depth.empty() || !fs::exists(folder / "intrinsic_depth.txt")) return calibration;
  expect_one_place(folder);
  calibration.depth_apart = true;
  calibration.depth_camera.model.pinhole = camera_of(folder / "intrinsic_depth.txt", read_depth_image(depth));
  return calibration;
}

/// A file an image; those that are not there, and those of images whose pose nobody knows, are left out.
Trajectory read_numbered_poses(const fs::path& folder, const std::vector<NumberedFile>& images, double fps) {
  Trajectory poses;
  for (const NumberedFile& image : images) {
    const fs::path file = folder / (image.file.stem().string() + ".txt");
    if (!fs::exists(file)) continue;
    if (const auto T_w_c = read_pose_matrix(file)) poses.push_back({time_of_number(image, fps), *T_w_c});
  }
  return poses;
}

}  // namespace

bool is_scannet(const fs::path& folder) {
  return fs::exists(folder / "intrinsic" / "intrinsic_color.txt") &&
         has_numbered(folder / "color", "", {".jpg", ".png"});
}

/// ScanNet as its own program exports it from .sens files: https://github.com/ScanNet/ScanNet, SensReader.
Recording read_scannet(const fs::path& folder, const std::optional<fs::path>& calibration,
                       SourceParameters& parameters) {
  Recording recording;
  recording.folder = folder;
  const double fps = take_numbered_fps(kScanNetFps, parameters);
  const auto colour = list_numbered(folder / "color", "", {".jpg", ".png"});
  if (colour.empty()) throw IoError(folder / "color", "holds no images called NUMBER.jpg");
  const auto depth =
      parameters.left_only() ? std::vector<NumberedFile>() : list_numbered(folder / "depth", "", {".png"});
  take_numbered_frames(colour, depth, fps, parameters, &recording);
  const auto own = [&]() -> std::optional<Calibration> {
    recording.calibration_file = folder / "intrinsic";
    return read_two_cameras(folder / "intrinsic", colour[0].file, depth.empty() ? fs::path() : depth[0].file);
  };
  take_numbered_calibration(calibration, own, 0.001, parameters, &recording);
  take_truth([&] { return read_numbered_poses(folder / "pose", colour, fps); }, &recording);
  return recording;
}

}  // namespace twofold
