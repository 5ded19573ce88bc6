#!/usr/bin/env bash
# ffmpeg.sh FOLDER: FFmpeg's libraries in FOLDER/lib, of the source of this Debian's package but with what videos of frames are
# made of alone. Debian's own load 100 libraries, 120 MB, of encoders and of protocols. The pixels are the same.
# What is in FOLDER already is not made again. Needs docker/packages/wheel.txt, and the mirror of this machine's apt.
set -euo pipefail
mkdir -p "$1"
folder=$(cd "$1" && pwd)
version=$(dpkg-query -W -f '${source:Version}' libavcodec-dev)
[ "$(cat "$folder/version" 2>/dev/null)" != "$version" ] || exit 0

# The mirror's list of sources, which a machine that only installs has not switched on.
apt=(-o "Dir::Etc::SourceList=$folder/sources.list" -o Dir::Etc::SourceParts=/dev/null -o "Dir::State::Lists=$folder/lists"
     -o APT::Sandbox::User=root)
apt-get indextargets --format 'deb-src $(REPO_URI) $(RELEASE) $(COMPONENT)' 'Created-By: Packages' >"$folder/sources.list"
mkdir -p "$folder/lists/partial"
apt-get "${apt[@]}" update -qq
rm -rf "$folder"/ffmpeg-*
(cd "$folder" && apt-get "${apt[@]}" source -qq "ffmpeg=$version")
cd "$folder"/ffmpeg-*/

demuxers=aac,ac3,apng,asf,avi,flv,gif,h264,hevc,ivf,m4v,matroska,mjpeg,mov,mpegps,mpegts,mpegvideo,ogg,yuv4mpegpipe
decoders=apng,bmp,cinepak,dnxhd,dvvideo,ffv1,ffvhuff,flashsv,flv,gif,h263,h264,hevc,huffyuv,jpegls,libdav1d,magicyuv,mjpeg
decoders+=,mpeg1video,mpeg2video,mpeg4,msmpeg4v1,msmpeg4v2,msmpeg4v3,msrle,msvideo1,png,prores,qtrle,rawvideo,theora,tscc
decoders+=,utvideo,v210,vc1,vp6f,vp8,vp9,wmv1,wmv2,wmv3,wrapped_avframe
# Sound is only recognised, so that it is no riddle beside the images.
sound=aac,ac3,mp2,mp3,pcm_s16be,pcm_s16le,vorbis
parsers=aac,ac3,av1,dnxhd,dvbsub,gif,h263,h264,hevc,mjpeg,mpeg4video,mpegaudio,mpegvideo,opus,png,vc1,vorbis,vp3,vp8,vp9
./configure --prefix="$folder" --enable-shared --disable-static --disable-debug --disable-doc --disable-programs \
  --disable-autodetect --disable-everything --disable-network --disable-avdevice --disable-avfilter --disable-postproc \
  --disable-swresample \
  --enable-gpl --enable-zlib --enable-libx264 --enable-libdav1d --enable-encoder=libx264 --enable-muxer=mp4 \
  --enable-protocol=file --enable-demuxer=$demuxers --enable-decoder=$decoders,$sound --enable-parser=$parsers
make -j "${JOBS:-$(nproc)}" install
printf '%s' "$version" >"$folder/version"
