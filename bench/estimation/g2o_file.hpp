#pragma once

#include <string>
#include <string_view>
#include <variant>

#include "estimation/pose_graph.hpp"

namespace twofold::bench {

using AnyPoseGraph = std::variant<PoseGraph<SE2>, PoseGraph<SE3>>;

/// Reads a pose graph in g2o's text format: VERTEX_SE3:QUAT, EDGE_SE3:QUAT, VERTEX_SE2, EDGE_SE2, FIX; blank
/// lines and lines starting with # are passed over. A name ending in .gz is decompressed.
///
/// g2o's vertices X_i map camera to world and its edges hold X_i^-1 X_j; here T_i = X_i^-1, T_j_i = (X_i^-1
/// X_j)^-1. g2o's error (translation, quaternion vector part) is PoseGraphError::kComponents up to the factor
/// 2 of the vector part, which the information matrices absorb, so that pose_graph_cost(..., kComponents) is
/// g2o's chi2. Poses are numbered by ascending id; the pose with the smallest id (or the one named by FIX) is
/// the origin. A file without vertices gets its poses by chain_constraints.
///
/// Throws std::runtime_error "NAME:LINE: what is wrong".
[[nodiscard]] AnyPoseGraph read_g2o(const std::string& path);

/// The same from text; `name` stands in for the file in messages.
[[nodiscard]] AnyPoseGraph parse_g2o(std::string_view text, const std::string& name);

}  // namespace twofold::bench
