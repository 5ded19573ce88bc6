#pragma once

namespace eventgan {

/// Sets how many threads LibTorch's operations use when the calling thread runs them; 0: as many as
/// the machine has cores. The last bits of a training depend on the number. Gives the number.
int use_training_threads(int requested);

}  // namespace eventgan
