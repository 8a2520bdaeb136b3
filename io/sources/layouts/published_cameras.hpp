#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "camera/calibration.hpp"
#include "io/sources/recording.hpp"

namespace twofold {

/// Datasets whose recordings come without a calibration: it stands on the dataset's page, or in its paper.
enum class PublicDataset : std::uint8_t {
  kFreiburg1,
  kFreiburg2,
  kFreiburg3,
  kBonn,
  kIclNuim,
  kSevenScenes,
  kReplica
};

struct PublishedCamera {
  const char* dataset;    ///< for people
  const char* where;      ///< the figures were published
  PinholeCamera pinhole;  ///< with the size of the images that it is for
  Distortion distortion;
  std::optional<double> readout;  ///< 0 of rendered images; else unknown, and found while the camera turns
};

/// The one place of the cameras that others published.
[[nodiscard]] const PublishedCamera& published_camera(PublicDataset dataset);

/// The same as a recording's calibration; a note says where it was published.
[[nodiscard]] Calibration take_published_camera(PublicDataset dataset, Recording* recording);

/// Of a recording whose folder keeps the name that its archive gives it (rgbd_dataset_freiburg1_desk,
/// rgbd_bonn_balloon, living_room_traj2_frei_png). The folder need not be there.
[[nodiscard]] std::optional<PublicDataset> dataset_by_name(const std::filesystem::path& folder);

}  // namespace twofold
