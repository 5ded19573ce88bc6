#include <climits>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "stages/frames/decoding/detail/still_layers.h"
#include "stages/frames/decoding/moving_still.h"
#include "stages/frames/decoding/pair_reader.h"
#include "stages/frames/decoding/prepared_frame.h"
#include "stages/labels/label_mapping.h"
#include "tests/stages/frames/decoding/still_image.h"
#include "tests/stages/frames/decoding/test_video.h"
#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

FramePair still_of(const FrameRef& image, const ImageMotion& motion, double label_position = 1) {
  FramePair pair;
  pair.previous = pair.next = image;
  pair.gap_frames = 1;
  pair.label_position = label_position;
  pair.motion = motion;
  return pair;
}

class Stills : public ::testing::Test {
 protected:
  FrameRef write(const cv::Mat& image, const std::string& name = "a.png") {
    cv::imwrite((folder_ / name).string(), image);
    return {.path = name, .index = 0};
  }

  Outcome<PreparedPair> read(const FramePair& pair) {
    return PairReader(folder_.path(), spec_).read(pair);
  }

  /// Frame 0 or 1 of a pair that can be read, grey levels.
  static cv::Mat frame(const PreparedPair& pair, int which) {
    cv::Mat levels(pair.content.height, pair.content.width, CV_8UC1);
    const float* input = pair.input.data() + which * pair.content.pixel_count();
    for (std::size_t i = 0; i < pair.content.pixel_count(); ++i) {
      levels.data[i] = static_cast<std::uint8_t>(std::lround((input[i] / 2 + 0.5f) * 255));
    }
    return levels;
  }

  static bool are_equal(const cv::Mat& a, const cv::Mat& b) {
    return a.size() == b.size() && cv::norm(a, b, cv::NORM_INF) == 0;
  }

  TemporaryFolder folder_;
  ImageSpec spec_;
};

TEST_F(Stills, AShiftByWholePixelsIsExact) {
  const cv::Mat image = noise({30, 40});
  const FrameRef file = write(image);
  // By (4, -3): n = 3 takes 3 rows and 3 * 40 / 30 = 4 columns a side; what is left keeps its size.
  spec_.size = ImageSize{24, 32};
  for (const GreyOrder order : {GreyOrder::kBeforeResize, GreyOrder::kAfterResize}) {
    spec_.grey = order;
    // A point goes from the previous frame to the next by (4, -3). Labelled is the next: of the
    // previous one pixel (x, y) is what comes to lie at (x + 4, y - 3) of the image.
    const auto before = *read(still_of(file, {.x_px = 4, .y_px = -3}, 1));
    EXPECT_TRUE(are_equal(frame(before, 1), image(cv::Rect(4, 3, 32, 24))));
    EXPECT_TRUE(are_equal(frame(before, 0), image(cv::Rect(8, 0, 32, 24))));
    // Labelled is the previous: of the next one (x, y) is what lay at (x - 4, y + 3).
    const auto after = *read(still_of(file, {.x_px = 4, .y_px = -3}, 0));
    EXPECT_TRUE(are_equal(frame(after, 0), image(cv::Rect(4, 3, 32, 24))));
    EXPECT_TRUE(are_equal(frame(after, 1), image(cv::Rect(0, 6, 32, 24))));
  }
}

TEST_F(Stills, WithoutMotionBothFramesAreTheImage) {
  for (const ImageSize size : {ImageSize{16, 16}, {17, 31}, {1, 1}, {2, 3}}) {
    const cv::Mat image = noise(size);
    const FrameRef file = write(image);
    for (const double position : {0.0, 1.0}) {
      const auto pair = *read(still_of(file, {}, position));
      EXPECT_TRUE(are_equal(frame(pair, 0), image)) << to_string(size);
      EXPECT_TRUE(are_equal(frame(pair, 1), image)) << to_string(size);
    }
  }
}

struct Case {
  ImageFit fit;
  ImageSize volume;
};

TEST_F(Stills, ABoxStaysOnItsObjectAndTheObjectMovesAsTold) {
  // A bright square of 30x24 in an image of 160x120.
  cv::Mat image(120, 160, CV_8UC1, cv::Scalar(20));
  const Rectangle box{41, 35, 71, 59};
  image(cv::Rect(41, 35, 30, 24)) = 220;
  const FrameRef file = write(image);
  const auto square_in = [](const cv::Mat& levels) {  // centre and area, pixel centres integers
    double sum = 0, x_sum = 0, y_sum = 0;
    for (int y = 0; y < levels.rows; ++y) {
      for (int x = 0; x < levels.cols; ++x) {
        const double weight = (levels.at<std::uint8_t>(y, x) - 20) / 200.0;
        sum += weight;
        x_sum += weight * x;
        y_sum += weight * y;
      }
    }
    return std::array{x_sum / sum, y_sum / sum, sum};
  };
  // An edge that is sampled anew lies up to 0.1 px beside itself; half a pixel's shift of either
  // image, which scaling makes of a wrong centre, is more.
  constexpr double kSampling_px = 0.1;
  const ImageMotion motion{3.3, -5.7, 1.8, 1.02};
  for (const Case& c : {Case{ImageFit::kStretch, {130, 150}},
                        {ImageFit::kLetterbox, {200, 200}},
                        {ImageFit::kCrop, {100, 140}}}) {
    spec_.size = c.volume;
    spec_.fit = c.fit;
    for (const double position : {1.0, 0.0}) {
      SCOPED_TRACE(std::string(to_string(c.fit)) + (position == 1 ? " before" : " after"));
      const FramePair pair = still_of(file, motion, position);
      const auto prepared = *read(pair);
      const Placement& placement = prepared.placement;
      EXPECT_EQ(prepared.content, visible_part(place({120, 160}, spec_)).size);

      const auto labelled = square_in(frame(prepared, position == 1 ? 1 : 0));
      const Rectangle in_volume = to_volume(placement, box);
      EXPECT_NEAR(labelled[0] + prepared.content_x + 0.5, (in_volume.left + in_volume.right) / 2,
                  kSampling_px);
      EXPECT_NEAR(labelled[1] + prepared.content_y + 0.5, (in_volume.top + in_volume.bottom) / 2,
                  kSampling_px);
      const double area = (in_volume.right - in_volume.left) * (in_volume.bottom - in_volume.top);
      EXPECT_NEAR(labelled[2] / area, 1, 0.01);

      // The square's middle of the moved frame is where the equation of ImageMotion puts it: from
      // the previous frame to the next x' = c + s R (x - c) + t, or back.
      const double angle = motion.angle_deg * 3.14159265358979323846 / 180;
      const double cos = std::cos(angle), sin = std::sin(angle);
      const double dx = 55.5 - 79.5, dy = 46.5 - 59.5;
      Point there;
      if (position == 0) {
        there = {79.5 + motion.scale * (cos * dx - sin * dy) + motion.x_px,
                 59.5 + motion.scale * (sin * dx + cos * dy) + motion.y_px};
      } else {
        const double u = (dx - motion.x_px) / motion.scale, v = (dy - motion.y_px) / motion.scale;
        there = {79.5 + cos * u + sin * v, 59.5 - sin * u + cos * v};
      }
      there = to_volume(placement, there);
      const auto moved = square_in(frame(prepared, position == 1 ? 0 : 1));
      EXPECT_NEAR(moved[0] + prepared.content_x, there.x, kSampling_px);
      EXPECT_NEAR(moved[1] + prepared.content_y, there.y, kSampling_px);
      const double grown = position == 0 ? motion.scale : 1 / motion.scale;
      EXPECT_NEAR(moved[2] / area, grown * grown, 0.015);
    }
  }
}

TEST_F(Stills, EveryPixelIsTheImageWhereItWas) {
  // Levels that rise by 5 a column (row): cubic interpolation gives straight lines back, but in the
  // outermost column (row), where it has less to go by; beyond the image they would not rise on.
  const ImageSize size{41, 47};
  for (const bool along_x : {true, false}) {
    cv::Mat image(size.height, size.width, CV_8UC1);
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(10 + 5 * (along_x ? x : y));
      }
    }
    const FrameRef file = write(image);
    for (const double position : {0.0, 1.0}) {
      const FramePair pair = still_of(file, {2.6, -1.7, 3, 0.96}, position);
      const Placement whole = place(size, {}, pair);
      spec_.size = whole.cut();  // nothing is resized
      const auto prepared = *read(pair);
      const cv::Mat moved = frame(prepared, position == 1 ? 0 : 1);
      const std::array<double, 6> map = moved_to_labelled(size, pair);
      const double* row = &map[along_x ? 0 : 3];
      for (int y = 0; y < moved.rows; ++y) {
        for (int x = 0; x < moved.cols; ++x) {
          const double at = row[0] * (x + whole.border_x) + row[1] * (y + whole.border_y) + row[2];
          ASSERT_NEAR(moved.at<std::uint8_t>(y, x), 10 + 5 * at, 1.2) << x << ", " << y;
        }
      }
    }
  }
}

TEST_F(Stills, WhatCannotBeHadIsAFaultThatNamesTheImage) {
  const auto why = [&](const FramePair& pair) {
    const auto outcome = read(pair);
    return is_fault(outcome) ? outcome.fault().reason : "no fault";
  };
  const FrameRef file = write(noise({16, 16}));
  for (const double position : {0.0, 1.0}) {
    EXPECT_THAT(why(still_of(file, {.x_px = 100}, position)),
                AllOf(StartsWith("expected a motion after which half of each side can be seen of "
                                 "an image of 16x16 pixels, got (100"),
                      HasSubstr(", in a.png")));
  }
  EXPECT_THAT(why(still_of({.path = "none.png"}, {})), HasSubstr(", in none.png"));
  const FrameRef widest = write(noise({1, kMostStillSide}), "widest.png");
  EXPECT_EQ(why(still_of(widest, {})), "no fault");
  const FrameRef wider = write(noise({1, kMostStillSide + 1}), "wider.png");
  EXPECT_EQ(why(still_of(wider, {})),
            "expected a still of at most 32766 pixels a side, got 32767x1, in wider.png");
}

TEST_F(Stills, MovedAndUnmovedImagesAreNotConfused) {
  const FrameRef file = write(noise({20, 30}));
  const FrameRef other = write(noise({20, 30}), "b.png");
  FramePair sequence;
  sequence.previous = file;
  sequence.next = other;
  const FramePair little = still_of(file, {.x_px = 1});
  const FramePair much = still_of(file, {.x_px = 4}, 0);
  const PairReader shared(folder_.path(), spec_);
  for (const FramePair& pair : {sequence, little, much, sequence, much, little}) {
    EXPECT_EQ(shared.read(pair)->input, read(pair)->input);
  }
}

class ReducedStills : public Stills {
 protected:
  /// Waves of some 60 px: a shift of half a pixel of the reduced image is 5 levels and more.
  static cv::Mat waves(ImageSize size) {
    cv::Mat image(size.height, size.width, CV_8UC3);
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const double level = 128 + 50 * std::sin(x / 9.0) + 50 * std::cos(y / 10.0);
        const auto grey = static_cast<std::uint8_t>(std::lround(level));
        image.at<cv::Vec3b>(y, x) = {grey, grey, grey};
      }
    }
    return image;
  }

  /// The file, decoded, and reduced.
  StillImage decoded(const FrameRef& file, int by) {
    const auto image = [&](int reduced_by) {
      return std::make_shared<const ColourFrame>(decode_image(
          open_image_file(folder_ / file.path), ImageOrientation::kStored, {}, reduced_by));
    };
    return {image(by), image(1)->size, by};
  }
};

TEST_F(ReducedStills, ShowWhatTheWholeOnesDo) {
  const FrameRef file = write(waves({336, 504}), "a.jpg");
  const Rectangle inside_it{200, 120, 320, 260}, at_the_border{400, 200, 504, 336};
  for (const int by : {2, 4, 8}) {
    spec_.size = ImageSize{320 / by, 480 / by};
    spec_.fit = ImageFit::kLetterbox;
    const auto expect_same = [&](const FramePair& pair, const Box& object) {
      const MovingStill whole(decoded(file, 1), pair, spec_, {object});
      const MovingStill reduced(decoded(file, by), pair, spec_, {object});
      const Placement& placement = whole.placement();
      EXPECT_EQ(reduced.placement(), placement);
      // Near the object's edge it is soft by pixels of the image, and other pixels are filled.
      const double room = (17.0 + 3 * by) * placement.scale_x();
      const Rectangle edge = to_volume(placement, object.xyxy);
      const auto is_certain = [&](int x, int y) {
        return pair.objects.empty() || !inside(edge, x, y, room) || inside(edge, x, y, -room);
      };
      const FramesBetween expected = whole.frames(pair), frames = reduced.frames(pair);
      EXPECT_EQ(frames.displacement_px, expected.displacement_px);
      const VisiblePart part = visible_part(placement);
      int certain = 0;
      for (const double u : {0.0, 0.4, 1.0}) {
        const GreyImage a = expected.at(u), b = frames.at(u);
        ASSERT_EQ(a.size, b.size);
        std::size_t i = 0;
        for (int y = 0; y < a.size.height; ++y) {
          for (int x = 0; x < a.size.width; ++x, ++i) {
            if (!is_certain(x + part.volume_x, y + part.volume_y)) continue;
            ++certain;
            ASSERT_NEAR(a.pixels[i], b.pixels[i], 2 + 1.5 * by) << x << ", " << y << " at " << u;
          }
        }
      }
      EXPECT_GT(certain, part.size.pixel_count());  // of three frames
      const PixelFlow flow = whole.flow(pair), other = reduced.flow(pair);
      std::size_t i = 0;
      for (int y = 0; y < placement.volume.height; ++y) {
        for (int x = 0; x < placement.volume.width; ++x, ++i) {
          if (!is_certain(x, y)) continue;
          ASSERT_EQ(flow.valid[i], other.valid[i]) << x << ", " << y;
          ASSERT_EQ(flow.px[i], other.px[i]) << x << ", " << y;
        }
      }
    };
    for (const double position : {0.0, 1.0}) {
      SCOPED_TRACE(std::to_string(by) + (position == 1 ? " before" : " after"));
      for (const Rectangle& box : {inside_it, at_the_border}) {
        for (const ImageMotion& motion : {ImageMotion{5, -3, 1.5, 1.03}, ImageMotion{}}) {
          FramePair pair = still_of(file, motion, position);
          if (motion != ImageMotion{}) expect_same(pair, object_at(box));
          pair.objects = {ImageMotion{.x_px = -9, .y_px = -6}};
          expect_same(pair, object_at(box));
        }
      }
    }
  }
}

TEST_F(ReducedStills, AreTakenOfJpegsThatAreFourTimesTheVolumeOrMore) {
  const cv::Mat image = noise({96, 144});
  const FrameRef jpeg = write(image, "a.jpg"), png = write(image, "a.png");
  const FramePair pair = still_of(jpeg, {});
  const auto frames_of = [&](const FrameRef& file, int by) {
    const MovingStill still(decoded(file, by), pair, spec_);
    const FramesBetween frames = still.frames(pair);
    return prepare_pair({frames.at(0).pixels, still.placement()},
                        {frames.at(1).pixels, still.placement()})
        .input;
  };
  struct Reduction {
    ImageSize volume;
    int by;
  };
  for (const Reduction& c : {Reduction{{96, 144}, 1},
                             {{25, 36}, 1},
                             {{24, 37}, 1},
                             {{24, 36}, 2},
                             {{12, 18}, 4},
                             {{7, 9}, 4},
                             {{6, 9}, 8},
                             {{1, 1}, 8}}) {
    spec_.size = c.volume;
    EXPECT_EQ(still_reduction({96, 144}, spec_, pair), c.by) << to_string(c.volume);
    EXPECT_EQ(read(pair)->input, frames_of(jpeg, c.by)) << to_string(c.volume);
    EXPECT_EQ(read(still_of(png, {}))->input, frames_of(png, 1)) << to_string(c.volume);
  }
  spec_.size = ImageSize{1, 1};
  for (const auto& [size, by] : {std::pair{ImageSize{100, 148}, 4}, {{98, 96}, 2}, {{99, 96}, 1}}) {
    EXPECT_EQ(still_reduction(size, spec_, pair), by);
  }
  EXPECT_EQ(still_reduction({8, 40000}, spec_, pair), 1);  // refused as whole ones are
  spec_.size = ImageSize{INT_MAX, 1};
  EXPECT_EQ(still_reduction({96, 144}, spec_, pair), 1);

  FramePair of_clip = pair;
  of_clip.motion.reset();
  of_clip.poses.resize(2);
  EXPECT_THROWS(MovingStill(decoded(jpeg, 2), of_clip, {}), std::runtime_error,
                "expected the whole image of a clip");
}

TEST_F(ReducedStills, CutOutTheSameObjects) {
  cv::Mat image = waves({336, 504});
  cv::ellipse(image, {260, 170}, {50, 80}, 0, 0, 360, cv::Scalar(240, 250, 250), cv::FILLED);
  const FrameRef file = write(image, "a.jpg");
  const Box box{.class_id = 0, .xyxy = {205, 85, 315, 255}};
  FramePair pair = still_of(file, {});
  pair.objects = {ImageMotion{.x_px = 12}};
  spec_.size = ImageSize{80, 120};
  const auto cut =
      *PairReader(folder_.path(), spec_).read(pair, ImageOrientation::kStored, 1, {box});
  EXPECT_EQ(cut.outlines, (OutlineCounts{.given = 0, .cut = 1, .ellipses = 0}));
  // 12 px of the image before, where the previous frame has its middle.
  const auto middle = [&](int which) {
    const cv::Mat bright = frame(cut, which) > 235;
    return cv::moments(bright, true).m10 / cv::moments(bright, true).m00;
  };
  EXPECT_NEAR(middle(1) - middle(0), 12 * 120.0 / 504, 0.2);
}

TEST_F(Stills, MovedFramesAreAsBrightAsTheLabelledOne) {
  cv::Mat grey = noise({240, 320}), colour;
  cv::GaussianBlur(grey, grey, {}, 2);
  cv::normalize(grey, grey, 0, 255, cv::NORM_MINMAX);
  cv::cvtColor(grey, colour, cv::COLOR_GRAY2BGR);
  const auto image = std::make_shared<const ColourFrame>(
      ColourFrame{{240, 320}, {colour.datastart, colour.dataend}});
  const FramePair pair = still_of({}, {.x_px = 4.25, .y_px = -3.25});
  const ImageSize cut = place(image->size, spec_, pair).cut();
  for (const ImageSize size : {cut, ImageSize{cut.height / 2, cut.width / 2}, {100, 133}}) {
    spec_.size = size;
    spec_.fit = ImageFit::kStretch;
    const MovingStill still(image, pair, spec_);
    const GreyImage moved = still.frames(pair).at(0);
    const auto placed = place_colour(move_still(*image, pair), still.placement());
    double difference = 0;
    for (std::size_t i = 0; i < moved.pixels.size(); ++i) {
      difference += double(moved.pixels[i]) - placed[3 * i];
    }
    EXPECT_NEAR(difference / moved.pixels.size(), 0, 0.07) << to_string(size);
  }
}

TEST_F(Stills, FramesOfAClipAreThoseOfBothPairsThatHoldThem) {
  const FrameRef file = write(noise({48, 64}));
  const auto box = [](double left) {
    return Box{.class_id = 0,
               .xyxy = {left, 16, left + 12, 32},
               .outline = {{{{left, 16}, {left + 12, 16}, {left + 12, 32}, {left, 32}}}}};
  };
  const auto pair_at = [&](double x) {
    FramePair pair = still_of(file, {});
    pair.motion.reset();
    for (const double at : {x, x + 1.5}) {
      pair.poses.push_back({{.x_px = at / 2}, {ImageMotion{.x_px = at}}});
    }
    return pair;
  };
  FramePair at_rest = pair_at(2);
  for (StillPose& pose : at_rest.poses) pose.objects = {std::nullopt};
  spec_.size = ImageSize{30, 40};
  const PairReader shared(folder_.path(), spec_);
  const auto read = [&](const PairReader& reader, const FramePair& pair, const Box& object) {
    return *reader.read(pair, ImageOrientation::kStored, 1, {object});
  };
  const auto first = read(shared, pair_at(0), box(24)),
             second = read(shared, pair_at(1.5), box(24));
  EXPECT_TRUE(are_equal(frame(first, 1), frame(second, 0)));
  EXPECT_FALSE(are_equal(frame(first, 0), frame(second, 0)));
  // Those of other boxes, or other things that move, are others.
  for (const auto& [pair, object] :
       {std::pair{pair_at(1.5), box(30)}, {at_rest, box(24)}, {pair_at(1.5), box(24)}}) {
    EXPECT_EQ(read(shared, pair, object).input,
              read(PairReader(folder_.path(), spec_), pair, object).input);
  }
}

TEST_F(Stills, OfAVideoItIsOpenedOnceWhateverTheOrder) {
  testing::write_counting_video(folder_ / "clip.avi", 120);
  constexpr int kUnderWay = 20;
  for (const int stride : {1, 3}) {
    testing::write_counting_video(folder_ / "clip.avi", 120);
    const PairReader reader(folder_.path(), {}, kUnderWay);
    for (int first = 0; first + kUnderWay * stride <= 120; first += kUnderWay * stride) {
      for (int i = kUnderWay - 1; i >= 0; --i) {  // the worst order
        const int number = first + i * stride;
        const auto outcome =
            reader.read(still_of(testing::video_ref("clip.avi", number), {.x_px = 2}),
                        ImageOrientation::kStored, stride);
        ASSERT_FALSE(is_fault(outcome)) << number << outcome.fault().reason;
        const cv::Mat moved = frame(*outcome, 0);
        EXPECT_NEAR(moved.at<std::uint8_t>(10, 10), 2 * number, 1);
        // The open video outlives its name; opening it a second time fails.
        fs::remove(folder_ / "clip.avi");
      }
    }
  }
}

TEST_F(Stills, ImagesForTheEyeShowWhatTheNetworkSees) {
  cv::Mat colour;
  cv::Mat channels[] = {noise({40, 60}), noise({40, 60}), noise({40, 60})};  // grey: all the same
  cv::merge(channels, 3, colour);
  const FramePair pair = still_of({}, {1.5, -2.25, 2, 0.97});
  const ImageSize size{40, 60};
  spec_.size = ImageSize{50, 50};
  spec_.fit = ImageFit::kLetterbox;
  const ColourFrame image{size, {colour.datastart, colour.dataend}};
  const MovingStill still(std::make_shared<const ColourFrame>(image), pair, spec_);
  const Placement& placement = still.placement();
  const FramesBetween frames = still.frames(pair);
  for (const int which : {0, 1}) {
    const auto placed = place_colour(which == 0 ? move_still(image, pair) : image, placement);
    const VisiblePart part = visible_part(placement);
    const GreyImage frame = frames.at(which);
    for (int y = 0; y < 50; ++y) {
      for (int x = 0; x < 50; ++x) {
        const bool seen = y >= part.volume_y && y < part.volume_y + part.size.height;
        const int expected = seen ? frame.pixels[(y - part.volume_y) * part.size.width + x] : 0;
        // Of noise, 1/32 px is up to 8 levels.
        ASSERT_NEAR(placed[3 * (y * 50 + x)], expected, which == 0 ? 8 : 0);
      }
    }
  }
}

}  // namespace
}  // namespace eventgan
