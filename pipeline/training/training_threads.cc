#include "pipeline/training/training_threads.h"

#include <ATen/Parallel.h>
#include <omp.h>

#include "pipeline/threads/thread_count.h"

namespace eventgan {

int use_training_threads(int requested) {
  const int threads = thread_count(requested);
  at::set_num_threads(threads);
  omp_set_num_threads(threads);  // oneDNN reads OpenMP's
  return threads;
}

}  // namespace eventgan
