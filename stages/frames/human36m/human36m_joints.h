#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace eventgan {

/// Names of Human3.6M's joints in the order in which annotations of that many joints hold them: 32
/// as the dataset itself names them (its end sites told apart by their parents), 17 as pose
/// trainers do, else "joint_0", "joint_1", ...
std::vector<std::string> human36m_joint_names(std::size_t count);

}  // namespace eventgan
