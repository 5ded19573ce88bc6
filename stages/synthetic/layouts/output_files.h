#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "stages/synthetic/scenes/image.h"

namespace eventgan {

/// The number in decimal, with zeros in front up to `digits`.
std::string numbered(int number, int digits);

/// Writes a file whose folder exists. Throws std::runtime_error naming the path.
void write_text(const std::filesystem::path& path, std::string_view text);

/// Write the file, whose folder must exist. Throw std::runtime_error naming the path.
void write_png(const Image& image, const std::filesystem::path& path);
void write_jpeg(const Image& image, const std::filesystem::path& path);

/// Copies a file to a new path. Throws std::runtime_error naming both.
void copy_output(const std::filesystem::path& from, const std::filesystem::path& to);

/// Makes a folder and those above it. Throws std::runtime_error naming the path.
void make_folder(const std::filesystem::path& path);

/// Writes what a scene shows from frame `first` to frame `last` and `intermediate_count`
/// intermediate frames, equally far apart, between each two frames: `folder`/00000.png, 00001.png
/// and so on. Nothing if `intermediate_count` is 0. Throws std::runtime_error naming the path.
void write_intermediate_frames(const std::function<Image(double)>& render, int first, int last,
                               int intermediate_count, const std::filesystem::path& folder);

}  // namespace eventgan
