#include "experiments/plot.hpp"
#include "experiments/why_filter/monte_carlo.hpp"

namespace twofold::bench {

void plot_case(const Case& c, Report& report) {
  std::vector<Series> accuracy, rms, bits, trade;
  int colour = 0;
  for (const int frames : frame_counts(c.setting)) {
    for (const int method : {kBa, kFilter}) {
      const std::string label = std::string(method_name(method)) + ", M = " + std::to_string(frames);
      Series e{.name = label, .markers = true, .dashed = method == kFilter, .colour = colour};
      Series r = e, b = e, t = e;
      for (const auto& [at, cell] : c.grids[method]) {
        if (at.first != frames || !c.robust(at)) continue;
        e.x.push_back(at.second);
        e.y.push_back(c.entropy(method, at));
        r.x.push_back(at.second);
        r.y.push_back(cell.rmse);
        b.x.push_back(at.second);
        b.y.push_back(c.entropy(method, at) / cell.joint);
        t.x.push_back(cell.joint);
        t.y.push_back(cell.rmse);
      }
      accuracy.push_back(e);
      rms.push_back(r);
      bits.push_back(b);
      trade.push_back(t);
    }
    ++colour;
  }
  const auto draw = [&](const std::vector<Series>& s, const char* title, const char* x, const char* y,
                        bool log_y) {
    PlotOptions plot{.title = std::string(title) + ", setting " + c.name(), .x_label = x, .y_label = y};
    plot.log_x = true;
    plot.log_y = log_y;
    return draw_plot(s, plot);
  };
  write_png(report.file("setting_" + c.name() + ".png"),
            tile({draw(accuracy, "entropy reduction", "points N", "bit", false),
                  draw(rms, "RMSE", "points N", "m", true),
                  draw(bits, "bits per second", "points N", "bit/s", true),
                  draw(trade, "error against cost", "joint updates [s]", "RMSE [m]", true)},
                 2));
}

void write_case(const Case& c, Report& report) {
  std::vector<std::vector<double>> rows;
  for (const int method : {kBa, kFilter}) {
    for (const auto& [at, cell] : c.grids[method]) {
      rows.push_back({static_cast<double>(method), static_cast<double>(at.first),
                      static_cast<double>(at.second), static_cast<double>(cell.trials),
                      static_cast<double>(cell.failures), cell.rmse, c.entropy(method, at), cell.joint,
                      cell.total, c.entropy(method, at) / cell.joint});
    }
  }
  report.csv(
      "setting_" + c.name() + ".csv",
      {"filter", "M", "N", "trials", "failures", "rmse_m", "entropy_bit", "joint_s", "total_s", "bits_per_s"},
      rows);
}

}  // namespace twofold::bench
