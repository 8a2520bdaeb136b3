#pragma once

#include <cholmod.h>
#include <omp.h>

#include <vector>

// Present when the BLAS is OpenBLAS.
extern "C" [[gnu::weak]] void openblas_set_num_threads(int);

namespace twofold {

/// Keeps OpenMP to the calling thread. CHOLMOD's supernodal code asks for four threads at every small copy
/// loop, whatever omp_set_num_threads says; they spin on the cores other threads need. The setting belongs to
/// the calling thread.
class OneThread {
 public:
  OneThread() : levels_(omp_get_max_active_levels()) { omp_set_max_active_levels(0); }
  ~OneThread() { omp_set_max_active_levels(levels_); }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  int levels_;
};

/// Silent CHOLMOD workspace.
struct CholmodCommon {
  CholmodCommon() {
    if (openblas_set_num_threads != nullptr) openblas_set_num_threads(1);
    cholmod_start(&c);
    c.print = 0;
    c.error_handler = nullptr;
  }
  ~CholmodCommon() { cholmod_finish(&c); }
  CholmodCommon(const CholmodCommon&) = delete;
  CholmodCommon& operator=(const CholmodCommon&) = delete;
  cholmod_common c;
};

/// View of a compressed lower triangle; x may be null for a pattern.
inline cholmod_sparse lower_triangle_view(int n, std::vector<int>& begin, std::vector<int>& row, double* x) {
  cholmod_sparse A{};
  A.nrow = A.ncol = n;
  A.nzmax = row.size();
  A.p = begin.data();
  A.i = row.data();
  A.x = x;
  A.stype = -1;
  A.itype = CHOLMOD_INT;
  A.xtype = x != nullptr ? CHOLMOD_REAL : CHOLMOD_PATTERN;
  A.dtype = CHOLMOD_DOUBLE;
  A.sorted = A.packed = 1;
  return A;
}

}  // namespace twofold
