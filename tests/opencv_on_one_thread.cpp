// As the program has it: OpenCV starts no threads of its own. ThreadSanitizer could not see how it waits for
// them.
#include <opencv2/core/utility.hpp>

namespace {

[[maybe_unused]] const bool kOneThread = (cv::setNumThreads(1), true);

}  // namespace
