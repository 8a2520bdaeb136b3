#pragma once

#include <cholmod.h>

#include <vector>

namespace twofold {

/// Silent CHOLMOD workspace. Only its orderings are used: they call no BLAS and have no threads.
struct CholmodCommon {
  CholmodCommon() {
    cholmod_start(&c);
    c.print = 0;
    c.error_handler = nullptr;
  }
  ~CholmodCommon() { cholmod_finish(&c); }
  CholmodCommon(const CholmodCommon&) = delete;
  CholmodCommon& operator=(const CholmodCommon&) = delete;
  cholmod_common c;
};

/// View of the pattern of a compressed lower triangle.
inline cholmod_sparse lower_triangle_view(int n, std::vector<int>& begin, std::vector<int>& row) {
  cholmod_sparse A{};
  A.nrow = A.ncol = n;
  A.nzmax = row.size();
  A.p = begin.data();
  A.i = row.data();
  A.stype = -1;
  A.itype = CHOLMOD_INT;
  A.xtype = CHOLMOD_PATTERN;
  A.dtype = CHOLMOD_DOUBLE;
  A.sorted = A.packed = 1;
  return A;
}

}  // namespace twofold
