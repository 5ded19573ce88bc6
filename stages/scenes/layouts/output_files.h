#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "stages/scenes/picture.h"

namespace eventgan {

/// The number in decimal, with zeros in front up to `digits`.
std::string numbered(int number, int digits);

/// Writes a file whose folder exists. Throws std::runtime_error naming the path.
void write_text(const std::filesystem::path& path, std::string_view text);

/// Copies a file to a new path. Throws std::runtime_error naming both.
void copy_output(const std::filesystem::path& from, const std::filesystem::path& to);

/// Makes a folder and those above it. Throws std::runtime_error naming the path.
void make_folder(const std::filesystem::path& path);

/// Writes what a scene shows from frame `first` to frame `last` and at `between` moments, equally
/// far apart, between each two frames: `folder`/00000.png, 00001.png and so on. Nothing if
/// `between` is 0. Throws std::runtime_error naming the path.
void write_moments(const std::function<Picture(double)>& picture, int first, int last, int between,
                   const std::filesystem::path& folder);

}  // namespace eventgan
