#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "twofold/estimate.hpp"

namespace twofold {

/// One version of the map. It never changes and may be held as long as one likes, by any thread: the mapper
/// goes on meanwhile and waits for nobody. A copy is another handle of the same version; one that was moved
/// from is an empty map.
///
/// Lengths are metres; those of a run with one camera (Sensor::kMono) that began with no map are of a unit of
/// its own, wherever [m] is said here.
/// Poses and positions are in the world of their map part, whose points x_world = T_world_camera x_camera.
///
/// Memory: versions share what they have in common. One that is held keeps what the map has replaced since,
/// at most memory_bytes(). Slam::held_maps() counts the handles' versions. Threads: all functions may be
/// called by several threads at once.
class TWOFOLD_API MapSnapshot {
 public:
  struct Keyframe {
    std::uint32_t id = kNoId;
    std::uint32_t part = kNoId;  ///< name of its map part (PoseEstimate::map_part), whose world is its own
    /// Number and time stamp of the frame it was made of; of another recording's if it is `loaded`: frames of
    /// this run may have the same.
    std::int64_t frame = 0;
    std::int64_t t_ns = 0;
    Pose T_world_camera;
    std::uint32_t points = 0;  ///< that it sees
    std::uint8_t window =
        0;                   ///< 1, 2: in the inner or outer window of the mapper's last round; 0: in neither
    bool has_place = false;  ///< described, so that it can be recognised
    bool loaded = false;     ///< it was in the map that the run went on with (SlamOptions::map)
  };

  /// Point::covariance of which nothing is known, as unknown_covariance() of a pose.
  [[nodiscard]] static constexpr std::array<double, 9> unknown_point_covariance() {
    std::array<double, 9> covariance{};
    covariance.fill(std::numeric_limits<double>::quiet_NaN());
    return covariance;
  }

  struct Point {
    std::uint32_t id = kNoId;
    std::uint32_t anchor = kNoId;      ///< keyframe that it was first seen in; may be gone by now
    std::uint32_t part = kNoId;        ///< map part, whose world `position` is in
    std::uint32_t observers = 0;       ///< keyframes that see it
    std::array<double, 3> position{};  ///< in the world of its part [m]
    /// 3x3 row by row [m^2], from all its measurements with the keyframes' poses taken as true. All NaN: not
    /// asked for, or the measurements do not determine the point.
    std::array<double, 9> covariance = unknown_point_covariance();
  };

  enum class EdgeKind : std::uint8_t {
    kCovisible,     ///< follows the two absolute poses, which are optimised together
    kMarginalised,  ///< a relative pose of its own, kept since its ends were optimised together
  };
  struct Edge {
    std::uint32_t from = kNoId;
    std::uint32_t to = kNoId;  ///< > from
    EdgeKind kind = EdgeKind::kCovisible;
    std::uint32_t shared_points = 0;
    Pose T_to_from;
  };

  /// A place that was recognised: the camera came back to what an older keyframe saw.
  struct Loop {
    std::uint32_t from = kNoId;  ///< the older keyframe; may be gone by now
    std::uint32_t to = kNoId;    ///< the keyframe that came back
    std::int64_t t_ns = 0;       ///< of that one
    std::int32_t inliers = 0;    ///< matches that agree
    /// Lengths around `to` over the same around `from`: how far the unit of one camera has drifted. 1 for
    /// others.
    double scale = 1;
    bool joins_parts = false;  ///< the two had different worlds: there is no drift, and no way between them
    /// By how much the map had the second keyframe's position wrong, relative to the first, before the loop
    /// was closed [m].
    double drift = 0;
    double turned = 0;     ///< likewise, its orientation [rad]
    double travelled = 0;  ///< along the keyframes from one to the other [m]
  };

  struct Part {
    std::uint32_t id = kNoId;
    std::uint32_t keyframes = 0;
  };

  /// An empty map, of version 0.
  MapSnapshot();
  MapSnapshot(const MapSnapshot&);
  MapSnapshot& operator=(const MapSnapshot&);
  MapSnapshot(MapSnapshot&&) noexcept;
  MapSnapshot& operator=(MapSnapshot&&) noexcept;
  ~MapSnapshot();

  [[nodiscard]] std::uint64_t version() const;
  /// The keyframe that the windows are around: the newest, or the one that the camera came back to. kNoId in
  /// an empty map.
  [[nodiscard]] std::uint32_t reference() const;

  /// A camera in one version of the map.
  struct CameraPose {
    std::uint32_t map_part = kNoId;
    Pose T_world_camera;
  };
  /// Where this version has the camera of a frame that was tracked at any other time: by way of its reference
  /// keyframe, or, when that was culled, of the keyframe that stands for it now. Nothing: the frame was not
  /// tracked; this version does not have its reference keyframe yet, which can be so for the newest frames;
  /// or that was culled before the 128 that were culled last, and no point is anchored in it any more, so
  /// that nobody knows what it hung on. Takes a microsecond.
  [[nodiscard]] std::optional<CameraPose> camera_pose(const PoseEstimate& estimate) const;
  /// Likewise of a keyframe by its id (PoseEstimate::reference_keyframe).
  [[nodiscard]] std::optional<CameraPose> keyframe_pose(std::uint32_t id) const;

  // Each is made anew by its call, ascending by id, culled ones left out: O(size of the map).
  [[nodiscard]] std::vector<Keyframe> keyframes() const;
  /// @param with_covariance  false leaves the covariances unknown, at a tenth of the time
  [[nodiscard]] std::vector<Point> points(bool with_covariance = true) const;
  [[nodiscard]] std::vector<Edge> edges() const;
  /// Loops that this run has closed by appearance, in the order they were found; none in a loaded map.
  [[nodiscard]] std::vector<Loop> loops() const;
  /// All map parts, ascending by id; one when everything is connected.
  [[nodiscard]] std::vector<Part> parts() const;

  /// What the version takes on the heap, shared or not, counted generously: what holding it costs is less.
  /// O(size of the map).
  [[nodiscard]] std::size_t memory_bytes() const;

  struct Impl;
  explicit MapSnapshot(std::shared_ptr<const Impl> impl);

 private:
  friend class MapSurface;
  friend class SurfaceSnapshot;
  std::shared_ptr<const Impl> impl_;
};

}  // namespace twofold
