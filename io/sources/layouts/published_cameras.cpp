#include "io/sources/layouts/published_cameras.hpp"

#include <array>
#include <string>
#include <utility>

#include <fmt/format.h>

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTumPage = "cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats";

Distortion radtan(double k1, double k2, double p1, double p2, double k3) {
  Distortion distortion;
  distortion.model = DistortionModel::kRadTan;
  distortion.coefficients = {k1, k2, p1, p2, k3};
  return distortion;
}

}  // namespace

const PublishedCamera& published_camera(PublicDataset dataset) {
  // In the order of PublicDataset.
  static const std::array<PublishedCamera, 7> kCameras{{
      {"TUM RGB-D, Freiburg 1",
       kTumPage,
       {517.306408, 516.469215, 318.643040, 255.313989, 640, 480},
       radtan(0.262383, -0.953104, -0.005358, 0.002628, 1.163314),
       {}},
      {"TUM RGB-D, Freiburg 2",
       kTumPage,
       {520.908620, 521.007327, 325.141442, 249.701764, 640, 480},
       radtan(0.231222, -0.784899, -0.003257, -0.000105, 0.917205),
       {}},
      // Its images were undistorted before they were published.
      {"TUM RGB-D, Freiburg 3", kTumPage, {535.4, 539.2, 320.1, 247.6, 640, 480}, {}, {}},
      {"Bonn RGB-D Dynamic",
       "www.ipb.uni-bonn.de/data/rgbd-dynamic-dataset",
       {542.822841, 542.576870, 315.593520, 237.756098, 640, 480},
       radtan(0.039903, -0.099343, -0.000730, -0.000144, 0.0),
       {}},
      // Published with fy = -480, of the renderer's axes, whose y points up; its images begin at the top.
      {"ICL-NUIM",
       "www.doc.ic.ac.uk/~ahanda/VaFRIC/iclnuim.html",
       {481.2, 480.0, 319.5, 239.5, 640, 480},
       {},
       0.0},
      // The depth camera's; nothing is published of the colour camera, whose images it does not fit to the
      // pixel.
      {"7-Scenes",
       "www.microsoft.com/en-us/research/project/rgb-d-dataset-7-scenes",
       {585, 585, 320, 240, 640, 480},
       {},
       {}},
      {"Replica",
       "github.com/cvg/nice-slam, configs/Replica/replica.yaml",
       {600, 600, 599.5, 339.5, 1200, 680},
       {},
       0.0},
  }};
  return kCameras.at(static_cast<std::size_t>(dataset));
}

Calibration take_published_camera(PublicDataset dataset, Recording* recording) {
  const PublishedCamera& camera = published_camera(dataset);
  Calibration calibration;
  calibration.left = {camera.pinhole, camera.distortion};
  calibration.readout = camera.readout;
  recording->notes.push_back(fmt::format(
      "{}: calibration as published for {} ({}); --calib FILE or ?fx=..&fy=..&cx=..&cy=.. instead",
      recording->folder.string(), camera.dataset, camera.where));
  return calibration;
}

std::optional<PublicDataset> dataset_by_name(const fs::path& folder) {
  // Of "." and of "FOLDER/", too.
  const std::string name = (fs::absolute(folder) / "").lexically_normal().parent_path().filename().string();
  for (const auto& [part, dataset] : {std::pair{"freiburg1", PublicDataset::kFreiburg1},
                                      {"freiburg2", PublicDataset::kFreiburg2},
                                      {"freiburg3", PublicDataset::kFreiburg3},
                                      {"rgbd_bonn", PublicDataset::kBonn},
                                      {"_frei_png", PublicDataset::kIclNuim}})
    if (name.find(part) != std::string::npos) return dataset;
  return std::nullopt;
}

}  // namespace twofold
