# EVENTGAN_PORTABLE: OpenCV, HDF5 and matio from Debian's archives (.a), of which the linker takes what is used. The shared ones
# load all that any of their functions may need: OpenCV's module video, for one optical flow, LLVM or protobuf; HDF5 curl with
# GnuTLS, Kerberos and LDAP; OpenCV's core OpenGL and Fortran. LAPACK stays, for calibration.
foreach(name IN ITEMS opencv_core opencv_imgproc opencv_video matio lapack_pic blas)
  find_library(EVENTGAN_STATIC_${name} lib${name}.a PATH_SUFFIXES blas REQUIRED)
endforeach()

add_library(eventgan_stand_ins STATIC docker/wheel/stand_ins.c)
set_target_properties(eventgan_stand_ins PROPERTIES POSITION_INDEPENDENT_CODE ON)
set(opencv ${EVENTGAN_STATIC_opencv_imgproc} ${EVENTGAN_STATIC_opencv_core} eventgan_stand_ins ${EVENTGAN_STATIC_lapack_pic}
           ${EVENTGAN_STATIC_blas} eventgan_stand_ins TBB::tbb ZLIB::ZLIB Threads::Threads ${CMAKE_DL_LIBS})
set(EVENTGAN_OPENCV_VIDEO ${EVENTGAN_STATIC_opencv_video})

set(hdf5)
foreach(library IN LISTS HDF5_C_LIBRARIES)
  get_filename_component(folder ${library} DIRECTORY)
  if(library MATCHES "/libhdf5[^/]*\\.so$")
    string(REGEX REPLACE "so$" "a" library ${library})
  elseif(library MATCHES "/libsz\\.so$")
    set(library ${folder}/libsz.a ${folder}/libaec.a)
  elseif(library MATCHES "/lib(curl|crypto|ssl)\\.so$")
    continue()  # HDF5's files in the cloud
  endif()
  list(APPEND hdf5 ${library})
endforeach()
set(HDF5_C_LIBRARIES ${hdf5})
set_target_properties(PkgConfig::matio PROPERTIES INTERFACE_LINK_LIBRARIES "${EVENTGAN_STATIC_matio};eventgan_hdf5")

add_link_options(-Wl,--gc-sections)
set(CMAKE_INSTALL_RPATH "$ORIGIN" ${ffmpeg_LIBRARY_DIRS})  # the weights' library, and FFmpeg's
