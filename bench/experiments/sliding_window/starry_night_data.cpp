#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>

#include "experiments/sliding_window/starry_night.hpp"

namespace twofold::bench {
namespace {

std::vector<std::vector<double>> read_rows(const std::string& file, std::size_t columns) {
  std::ifstream in(file);
  if (!in) throw std::runtime_error("cannot open " + file);
  std::vector<std::vector<double>> rows;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream stream(line);
    std::vector<double> row(columns);
    for (double& v : row) {
      if (!(stream >> v)) {
        throw std::runtime_error(file + ", line " + std::to_string(number) + ": expected " +
                                 std::to_string(columns) + " numbers");
      }
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

std::map<std::string, std::vector<double>> read_keys(const std::string& file) {
  std::ifstream in(file);
  if (!in) throw std::runtime_error("cannot open " + file);
  std::map<std::string, std::vector<double>> keys;
  std::string line;
  while (std::getline(in, line)) {
    std::istringstream stream(line);
    std::string key;
    stream >> key;
    for (double v; stream >> v;) keys[key].push_back(v);
  }
  for (const auto& [key, count] : std::map<std::string, std::size_t>{{"fu", 1},
                                                                     {"fv", 1},
                                                                     {"cu", 1},
                                                                     {"cv", 1},
                                                                     {"baseline", 1},
                                                                     {"C_c_v", 9},
                                                                     {"rho_v_c_v", 3},
                                                                     {"v_var", 3},
                                                                     {"w_var", 3},
                                                                     {"y_var", 4}}) {
    if (keys[key].size() != count) {
      throw std::runtime_error(file + ": key " + key + " needs " + std::to_string(count) + " numbers");
    }
  }
  return keys;
}

Vector3 vector3(const std::vector<double>& row, std::size_t at) {
  return {row[at], row[at + 1], row[at + 2]};
}

}  // namespace

StarryNight load_starry_night(const std::string& folder, int first, int steps) {
  StarryNight data;
  auto keys = read_keys(folder + "/camera.txt");
  data.rig.camera = {keys["fu"][0], keys["fv"][0], keys["cu"][0], keys["cv"][0], 640, 480};
  data.rig.baseline = keys["baseline"][0];
  Matrix3 C_c_v;
  for (int i = 0; i < 9; ++i) C_c_v(i / 3, i % 3) = keys["C_c_v"][static_cast<std::size_t>(i)];
  data.T_c_v = SE3(C_c_v, -C_c_v * vector3(keys["rho_v_c_v"], 0));
  Vector6 variance;
  variance << vector3(keys["v_var"], 0), vector3(keys["w_var"], 0);

  auto rows = read_rows(folder + "/states.txt", 14);
  if (first < 0 || first >= static_cast<int>(rows.size())) {
    throw std::runtime_error(folder + "/states.txt has no step " + std::to_string(first));
  }
  rows.erase(rows.begin(), rows.begin() + first);
  if (static_cast<int>(rows.size()) > steps) rows.resize(static_cast<std::size_t>(steps));
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const auto& row = rows[k];
    data.t.push_back(row[1]);
    const SO3 C_v_i = SO3::exp(-vector3(row, 2));  // the file's formula has - sin(a) n^
    data.T_v_i.emplace_back(C_v_i, -(C_v_i * vector3(row, 5)));
    FilterFrame frame;
    if (k > 0) {  // velocities of the previous step carry to this one
      const auto& last = rows[k - 1];
      frame.motion =
          motion_from_velocity(vector3(last, 11), vector3(last, 8), data.T_c_v, variance, row[1] - last[1]);
    }
    data.frames.push_back(std::move(frame));
  }
  for (const auto& row : read_rows(folder + "/landmarks.txt", 4)) data.landmarks.push_back(vector3(row, 1));

  const auto& y = keys["y_var"];
  const Vector3 information(1 / y[0], 2 / (y[1] + y[3]), 1 / y[2]);
  for (const auto& row : read_rows(folder + "/observations.txt", 6)) {
    if (row[0] < first || row[0] >= first + static_cast<double>(data.frames.size())) continue;
    const auto k = static_cast<std::size_t>(row[0]) - static_cast<std::size_t>(first);
    LandmarkObservation o;
    o.landmark = static_cast<std::int64_t>(row[1]);
    o.pixel = Vector3(row[2], 0.5 * (row[3] + row[5]), row[4]);
    o.information = information.asDiagonal();
    data.frames[k].observations.push_back(o);
  }
  return data;
}

}  // namespace twofold::bench
