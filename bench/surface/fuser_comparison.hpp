#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "camera/rig.hpp"
#include "geometry/se3.hpp"
#include "geometry/triangle_mesh.hpp"

namespace twofold {

/// A depth image as `twofold surface --poses truth` takes it.
struct PosedDepth {
  cv::Mat depth;   ///< CV_16UC1 in units of Rig::depth_unit
  cv::Mat colour;  ///< CV_8UC3: blue, green, red
  SE3 T_c_v;       ///< v: the frame of the fuser's grid
};

/// What makes a surface of depth images.
class DepthFuser {
 public:
  virtual ~DepthFuser() = default;
  /// Whatever this wants to have of an image before the clock runs.
  virtual void prepare(const PosedDepth& /*image*/) {}
  virtual void fuse(const PosedDepth& image) = 0;
  /// Without normals if it makes none.
  virtual TriangleMesh mesh() = 0;
};

struct NamedFuser {
  std::string name;  ///< of its files, too
  std::unique_ptr<DepthFuser> fuser;
};

/// How voxels are laid out for all of them.
struct FuserSettings {
  Rig rig;
  double voxel = 0.005;   ///< [m]
  double truncation = 4;  ///< [voxels]
};

/// The fusers that one program compares with Twofold's own.
using MakeFusers = std::vector<NamedFuser> (*)(const FuserSettings&);

/// PROGRAM SOURCE FOLDER [VOXEL [EVERY [TRUNCATION]]]: every EVERY-th (24) frame of a source with true poses
/// goes to Twofold's fusion and to the others', in turn. Their grids are turned against the source's world,
/// whose walls would lie along one grid's samples and between those of another. Prints processor times of the
/// whole process; FOLDER gets each mesh as PLY, for `twofold eval --surface`, and as PNG.
/// @return  exit code
int compare_fusers(int argc, char** argv, MakeFusers make_others);

/// The image that fusers get whose library does not leave out what sensors see wrong: readings beside a jump
/// in depth are 0, as Twofold leaves them out.
[[nodiscard]] cv::Mat without_jumps(const Rig& rig, const cv::Mat& depth);

}  // namespace twofold
