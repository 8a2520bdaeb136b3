#include "loopclosure/vocabulary.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>

#include <fmt/format.h>

#include "apps/command_line.hpp"
#include "apps/vocabulary/place_evaluation.hpp"
#include "apps/vocabulary/training_images.hpp"
#include "apps/vocabulary/vocabulary_trainer.hpp"
#include "engine/clock.hpp"
#include "imaging/corner_selection.hpp"
#include "io/files/image_file.hpp"
#include "io/files/io_error.hpp"
#include "loopclosure/default_vocabulary.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

// Thesis 6.4.2: training images give 500 to 2000 corners each.
constexpr int kTrainingCorners = 1000;

struct TrainArguments {
  std::vector<std::string> inputs;
  std::string out;
  int every = 1;
  VocabularyTrainerOptions options;
};

Vocabulary vocabulary_or_default(const std::string& file) {
  if (file.empty()) return load_default_vocabulary();
  try {
    return Vocabulary::load(file);
  } catch (const std::runtime_error& error) {
    throw IoError(error.what());
  }
}

void train(const TrainArguments& arguments) {
  ImageDescriber describer(kTrainingCorners);
  std::vector<std::vector<BinaryDescriptor>> images;
  std::size_t corners = 0;
  for (const std::string& input : arguments.inputs) {
    for_each_image(input, arguments.every, [&](const cv::Mat& image) {
      images.emplace_back();
      for (const DescribedCorner& corner : describer.describe(image)) {
        images.back().push_back(corner.descriptor);
      }
      corners += images.back().size();
    });
  }
  const Vocabulary vocabulary = train_vocabulary(images, arguments.options);
  vocabulary.save(arguments.out);
  fmt::print("{} images, {} corners: {} words, depth {}, {} bytes, written to {}\n", images.size(), corners,
             vocabulary.word_count(), vocabulary.depth(), fs::file_size(arguments.out), arguments.out);
}

void print_info(const std::string& file) {
  const std::int64_t begin_ns = steady_now_ns();
  const Vocabulary vocabulary = vocabulary_or_default(file);
  const double ms = static_cast<double>(steady_now_ns() - begin_ns) * 1e-6;
  double least = 1e9, most = 0, sum = 0;
  for (const Vocabulary::Node& node : vocabulary.nodes()) {
    if (node.child_count > 0) continue;
    least = std::min<double>(least, node.idf);
    most = std::max<double>(most, node.idf);
    sum += node.idf;
  }
  fmt::print(
      "words   {}\nnodes   {}\ndepth   {}\nidf     {:.3f} to {:.3f}, mean {:.3f}\nloaded  in {:.2f} ms\n",
      vocabulary.word_count(), vocabulary.nodes().size(), vocabulary.depth(), least, most,
      sum / static_cast<double>(vocabulary.word_count()), ms);
}

void print_score(const std::string& file, const std::string& a, const std::string& b) {
  const Vocabulary vocabulary = vocabulary_or_default(file);
  ImageDescriber describer(CornerSelectionOptions().wanted);
  const auto corners_a = describer.describe(reduced(read_grey_image(a)));
  const auto corners_b = describer.describe(reduced(read_grey_image(b)));
  fmt::print("{:.6f}\n", bag_score(vocabulary.bag(corners_a), vocabulary.bag(corners_b)));
}

void add_train(CLI::App& parent, int& exit_code) {
  auto arguments = std::make_shared<TrainArguments>();
  CLI::App* command = parent.add_subcommand("train", "Learn words from images");
  command->add_option("IMAGES", arguments->inputs, "Image files, folders of them, or sources of frames")
      ->required();
  command->add_option("-o,--out", arguments->out, "File to write")->required();
  command->add_option("--every", arguments->every, "Take each Nth image of folders and sources")
      ->check(above_zero())
      ->capture_default_str();
  command->add_option("--branching", arguments->options.branching, "Children of a node of the tree")
      ->check(CLI::Range(2, 64))
      ->capture_default_str();
  command->add_option("--levels", arguments->options.levels, "Of the tree: at most branching^levels words")
      ->check(CLI::Range(1, 6))
      ->capture_default_str();
  command->add_option("--seed", arguments->options.seed, "Of the first medians")->capture_default_str();
  command->callback([arguments, &exit_code] {
    train(*arguments);
    exit_code = kOk;
  });
}

void add_evaluate(CLI::App& parent, const std::shared_ptr<std::string>& file, int& exit_code) {
  auto arguments = std::make_shared<PlaceEvaluationArguments>();
  CLI::App* command = parent.add_subcommand(
      "evaluate", "Precision and recall on a set of places: recognition alone, and after verification");
  command->add_option("SET", arguments->set, "Folder of images in order of time, or a source with true poses")
      ->required();
  command->add_option("--pairs", arguments->pairs,
                      "True pairs of a set without poses: a file of 'i j' lines (1-based), or 1-10,2-3");
  command->add_option("--tolerance", arguments->tolerance, "Images that far from a true pair's are true too")
      ->capture_default_str();
  command->add_option("--gap", arguments->gap, "Images that near in time are never candidates")
      ->capture_default_str();
  command->add_option("--max-distance", arguments->max_distance, "Between cameras at the same place [m]")
      ->capture_default_str();
  command->add_option("--max-angle", arguments->max_angle_deg, "Between their optical axes [deg]")
      ->capture_default_str();
  command->add_option("--every", arguments->every, "Take each Nth frame")->check(above_zero());
  command->add_option("--plot", arguments->plot, "Draw precision over recall to this PNG file");
  command->add_option("--csv", arguments->csv, "Write what became of each candidate, stage by stage");
  command->callback([arguments, file, &exit_code] {
    evaluate_places(*arguments, vocabulary_or_default(*file));
    exit_code = kOk;
  });
}

void add_info(CLI::App& parent, const std::shared_ptr<std::string>& file, int& exit_code) {
  CLI::App* command = parent.add_subcommand("info", "Size and weights");
  command->callback([file, &exit_code] {
    print_info(*file);
    exit_code = kOk;
  });
}

void add_score(CLI::App& parent, const std::shared_ptr<std::string>& file, int& exit_code) {
  auto images = std::make_shared<std::pair<std::string, std::string>>();
  CLI::App* command = parent.add_subcommand("score", "Likeness of two images, 0 to 1");
  command->add_option("A", images->first, "image file")->required();
  command->add_option("B", images->second, "image file")->required();
  command->callback([file, images, &exit_code] {
    print_score(*file, images->first, images->second);
    exit_code = kOk;
  });
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  CLI::App app{"Visual words for Twofold: train, inspect, evaluate", "twofold-vocabulary"};
  app.require_subcommand(1);
  auto file = std::make_shared<std::string>();
  app.add_option("--vocabulary", *file, "Vocabulary file instead of the built-in one");
  int exit_code = twofold::kOk;
  twofold::add_train(app, exit_code);
  twofold::add_info(app, file, exit_code);
  twofold::add_score(app, file, exit_code);
  twofold::add_evaluate(app, file, exit_code);
  return twofold::run_command_line(app, argc, argv, exit_code);
}
