#include "sparse/panel_structure.hpp"

#include <algorithm>
#include <numeric>

namespace twofold {
namespace {

/// Of column j below the diagonal.
int row_count(const BlockStructure& s, int j) {
  return s.factor_begin[j + 1] - s.factor_begin[j] - 1;
}

/// Is column j + 1 the parent of column j in the elimination tree, which has all rows of j?
bool next_is_parent(const BlockStructure& s, int j) {
  return row_count(s, j) > 0 && s.factor_row[s.factor_begin[j] + 1] == j + 1;
}

/// Wider panels mean fewer of them and longer products, but a wide one has little left to gain.
bool worth_widening(int width, double zeros, double blocks) {
  return zeros <= (width <= 4 ? 0.2 : 0.04) * blocks;
}

/// First columns of the panels, rising, and the number of columns. Back from the last column, each joins the
/// panel on its right if that begins with its parent and gains few blocks of zeros.
std::vector<int> panel_starts(const BlockStructure& s) {
  std::vector<int> starts{s.nodes()};
  double zeros = 0;
  for (int j = s.nodes() - 2; j >= 0; --j) {
    const int width = starts.back() - j;  // together with column j
    const int below = row_count(s, starts.back() - 1);
    const double new_zeros = zeros + (width - 1 + below - row_count(s, j));
    const double blocks = width * (0.5 * (width + 1) + below);
    if (next_is_parent(s, j) && worth_widening(width, new_zeros, blocks)) {
      zeros = new_zeros;
    } else {
      starts.push_back(j + 1);
      zeros = 0;
    }
  }
  if (s.nodes() > 0) starts.push_back(0);
  std::reverse(starts.begin(), starts.end());
  return starts;
}

void find_updates(const std::vector<int>& panel_of, PanelStructure& p) {
  const int n = static_cast<int>(p.panels.size());
  const auto for_each_update = [&](auto&& visit) {
    for (int source = 0; source < n; ++source) {
      const auto& panel = p.panels[source];
      const auto target = [&](int i) { return panel_of[p.row[panel.begin + i]]; };
      for (int i = panel.width, end = i; i < panel.height(); i = end) {
        while (end < panel.height() && target(end) == target(i)) ++end;
        visit(target(i), PanelStructure::Update{source, i, end});
      }
    }
  };
  p.update_begin.assign(n + 1, 0);
  for_each_update([&](int target, const auto&) { ++p.update_begin[target + 1]; });
  std::partial_sum(p.update_begin.begin(), p.update_begin.end(), p.update_begin.begin());
  p.updates.resize(p.update_begin[n]);
  std::vector<int> next(p.update_begin.begin(), p.update_begin.end() - 1);
  for_each_update([&](int target, const auto& update) { p.updates[next[target]++] = update; });
}

}  // namespace

PanelStructure gather_panels(const BlockStructure& s) {
  PanelStructure p;
  std::vector<int> panel_of;  // by column
  const std::vector<int> starts = panel_starts(s);
  for (std::size_t k = 0; k + 1 < starts.size(); ++k) {
    const int first = starts[k], last = starts[k + 1] - 1;
    PanelStructure::Panel panel{first, last + 1 - first, static_cast<int>(p.row.size()), 0, p.blocks};
    for (int j = first; j < last; ++j) p.row.push_back(j);
    p.row.insert(p.row.end(), s.factor_row.begin() + s.factor_begin[last],
                 s.factor_row.begin() + s.factor_begin[last + 1]);
    panel.end = static_cast<int>(p.row.size());
    p.blocks += static_cast<std::size_t>(panel.width) * panel.height();
    panel_of.resize(last + 1, static_cast<int>(k));
    p.panels.push_back(panel);
  }
  find_updates(panel_of, p);
  return p;
}

}  // namespace twofold
