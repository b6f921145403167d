"""Sentences of errors and warnings, in simplified Chinese."""

TEXTS = {
    # --- a capture before it is learned
    "{count} photos are too few here: new views will be soft or foggy, about {psnr} dB. {more} more where the picture shows it would give about {gain} dB; the widest hole is {hole} degrees, {where}.": (
        "这里 {count} 张照片太少：新视图会模糊或像雾，约为 {psnr} dB。在图中所示处补拍 {more} 张可提高约 {gain} dB；最大的空缺为 {hole} 度，{where}。"
    ),
    "{count} photos: new views will have about {psnr} dB (give or take {error}). {more} more would give about {gain} dB; the widest hole is {hole} degrees, {where}.": (
        "{count} 张照片：新视图约为 {psnr} dB（误差约 {error}）。补拍 {more} 张可提高约 {gain} dB；最大的空缺为 {hole} 度，{where}。"
    ),
    "above {first} and {second}": "在 {first} 和 {second} 上方",
    "below {first} and {second}": "在 {first} 和 {second} 下方",
    "between {first} and {second}": "在 {first} 和 {second} 之间",
    "Less sharp than the photos beside them: {names}. Take them again, or leave them out.": (
        "不如相邻照片清晰：{names}。请重拍，或不使用它们。"
    ),
    "Exposed otherwise than the rest, by up to {stops} stops: {names}. Lock the exposure.": (
        "曝光与其余照片不同，最多相差 {stops} 档：{names}。请锁定曝光。"
    ),
    "Of another white balance than the rest: {names}. Lock the white balance.": (
        "白平衡与其余照片不同：{names}。请锁定白平衡。"
    ),
    "Photos and camera poses miss each other by {pixels} pixels: find the poses again.": (
        "照片与相机位姿相差 {pixels} 像素：请重新求解位姿。"
    ),
    "{share} % of neighboring photos share too little to be compared: take more between them, of things with texture.": (
        "{share} % 的相邻照片共有内容太少，无法比较：请在它们之间补拍有纹理的内容。"
    ),
    "{share} % of what the photos show is in one or two of them alone, and will be guesswork.": (
        "照片内容的 {share} % 只出现在一两张照片中，将只能猜测。"
    ),
    "{share} % of {name} is thinner than {pixels} pixels: parts of it may be lost. A larger preset, or photos from nearer, would show them.": (
        "{name} 的 {share} % 细于 {pixels} 像素：部分可能丢失。更大的预设或更近的照片可以显示它们。"
    ),
    # --- scene, capture, project
    "The scene {name} has no KaRF project.": "场景 {name} 没有 KaRF 项目。",
    "The scene {name} has no active view.": "场景 {name} 没有当前视图。",
    "The scene {name} has no camera of the view {view}.": "场景 {name} 没有视图 {view} 的相机。",
    "The scene {name} has no camera.": "场景 {name} 没有相机。",
    "The scene {name} has no capture.": "场景 {name} 没有拍摄。",
    "The scene {name} has no captured cameras.": "场景 {name} 没有拍摄相机。",
    "The scene {name} looks through no captured view.": "场景 {name} 没有透过任何拍摄视图查看。",
    "The scene has no captured cameras.": "场景没有拍摄相机。",
    "The capture has no view {view}.": "拍摄中没有视图 {view}。",
    "The view {name} has no photo.": "视图 {name} 没有照片。",
    "The camera {name} is mirrored or unevenly scaled, itself or by its parents or the rig.": (
        "相机 {name} 自身或因其父级或相机组而被镜像或不均匀缩放。"
    ),
    "{name} is not a perspective camera.": "{name} 不是透视相机。",
    "{name} has another picture or pixel aspect than {other}.": "{name} 的画面或像素宽高比与 {other} 不同。",
    "Import a capture first.": "请先导入拍摄。",
    "Import the capture first.": "请先导入该拍摄。",
    "Import the capture again.": "请重新导入该拍摄。",
    "Choose one in the KaRF panel.": "请在 KaRF 面板中选择一个。",
    "Choose one from the list.": "请从列表中选择一个。",
    "Choose another view.": "请选择另一个视图。",
    "The project has moved, but the file could not be saved ({error}).": "项目已移动，但文件无法保存（{error}）。",
    "Save it: as it is on the disk it knows the project where that was, and there it still is.": "请保存文件：磁盘上的文件仍指向项目的旧位置，项目在那里依然存在。",
    "{path} is not there yet.": "{path} 尚不存在。",
    "Render something first.": "请先渲染。",
    "This file was not saved yet.": "此文件尚未保存。",
    "Save it first: the project moves beside it.": "请先保存：项目会移到它旁边。",
    "The project cannot be copied to {path} ({error}).": "无法将项目复制到 {path}（{error}）。",
    "Free some space, or save the file elsewhere; the project stays where it was.": "请释放空间，或将文件保存到别处；项目保持原位。",
    "A KaRF job is running.": "有 KaRF 任务正在运行。",
    "{name} shows no color like {color}.": "{name} 没有像 {color} 这样的颜色。",
    "Pick the left color on the object, in the picture as it is.": "请在画面中的物体上拾取左侧颜色。",
    "Add one, or choose a camera of the capture.": "请添加一个，或选择拍摄的某个相机。",
    "Apply the scale, or give all three axes the same.": "请应用缩放，或让三个轴的缩放相同。",
    "Set the camera's type to Perspective.": "请将相机类型设为透视。",
    "Blender keeps these per scene: split the file, and import each part into a scene of its own.": (
        "Blender 按场景保存这些设置：请拆分文件，并将各部分导入各自的场景。"
    ),
    "The scene that asked for a capture is gone or has another project: import {out} yourself.": (
        "请求相机位姿的场景已不在或换了项目：请自行导入 {out}。"
    ),
    "The scene that asked for this is gone or has another project. {result}": "提出此请求的场景已不在或换了项目。{result}",
    "The scene that asked for this is gone or has another project. The result is in {project}; choose that as the "
    "project to bring it in.": ("提出此请求的场景已不在或换了项目。结果在 {project} 中；将其选为项目即可引入。"),
    # --- objects of splats
    "{name} is no object of splats.": "{name} 不是高斯泼溅物体。",
    "Choose one that Blender or 3DGS Render has imported from a .ply.": (
        "请选择由 Blender 或 3DGS Render 从 .ply 导入的物体。"
    ),
    "{name} is in Edit Mode.": "{name} 处于编辑模式。",
    "Leave it first.": "请先退出该模式。",
    "{name} has {count} points where {n} splats have colors.": "{name} 有 {count} 个点，而有颜色的高斯为 {n} 个。",
    "The object has {count} points, and the scene {n} splats, {n_solid} of them without the background.": (
        "该物体有 {count} 个点，而场景有 {n} 个高斯，其中不含背景的有 {n_solid} 个。"
    ),
    "The object's points are not where the scene's splats are.": "该物体的点不在场景高斯的位置上。",
    "Choose an object that was imported from this scene's splats.": "请选择从本场景的泼溅导入的物体。",
    "Choose an object that was imported from this scene's splats, and whose points were not moved.": (
        "请选择从本场景的泼溅导入、且各点未被移动的物体。"
    ),
    "{folder} shows no splats.": "{folder} 不显示高斯泼溅。",
    "Learn splats first; they need the package numba and render.source=splats.": (
        "请先学习高斯泼溅；需要软件包 numba 和 render.source=splats。"
    ),
    "An edit that replaces colors cannot be baked into splats.": "替换颜色的编辑无法烘焙到高斯泼溅中。",
    "Make it one that adds.": "请改为叠加颜色的编辑。",
    # --- files and pictures
    "{path} cannot be read as a picture.": "无法将 {path} 作为图片读取。",
    "{path} cannot be read: {reason}.": "无法读取 {path}：{reason}。",
    "{path} cannot be written to.": "无法写入 {path}。",
    "{path} is {width}x{height} pixels where its camera has {expected_width}x{expected_height}.": (
        "{path} 为 {width}x{height} 像素，而其相机为 {expected_width}x{expected_height}。"
    ),
    "{name} has no pixels.": "{name} 没有像素。",
    "Check the file.": "请检查该文件。",
    "Check the path.": "请检查路径。",
    "Use PNG or JPEG.": "请使用 PNG 或 JPEG。",
    "Free some space, or choose another folder.": "请腾出一些空间，或选择另一个文件夹。",
    "Is there space, is the drive connected, and may you write there? Else choose another folder.": (
        "那里是否有空间、驱动器是否已连接、您是否有写入权限？否则请选择另一个文件夹。"
    ),
    "Choose another picture.": "请选择另一张图片。",
    # --- engine and jobs
    "There is no engine yet.": "还没有引擎。",
    "There is no engine yet. Press Install Engine, or set Engine Python below to a Python that has PyTorch.": "还没有引擎。请点击“安装引擎”，或在下方将“引擎 Python”设为装有 PyTorch 的 Python。",
    "Press Install Engine in the KaRF preferences, or set Engine Python there to a Python that has PyTorch.": (
        "请在 KaRF 偏好设置中按“安装引擎”，或将“引擎 Python”设为带有 PyTorch 的 Python。"
    ),
    "The engine's Python {python} does not exist.": "引擎的 Python {python} 不存在。",
    "The engine's Python {python} is not given by its whole path.": "引擎的 Python {python} 不是完整路径。",
    "Set it in the KaRF preferences.": "请在 KaRF 偏好设置中设置它。",
    "Set it in the KaRF preferences, in the file browser with Relative Path off.": (
        "请在 KaRF 偏好设置中设置它，并在文件浏览器中关闭“相对路径”。"
    ),
    "Set Engine Python in the KaRF preferences.": "请在 KaRF 偏好设置中设置“引擎 Python”。",
    "{python} cannot be started ({error}).": "无法启动 {python}（{error}）。",
    "No installation is running.": "没有正在运行的安装。",
    "The engine is being installed already.": "引擎正在安装。",
    "The engine did not answer after its start.": "引擎启动后没有应答。",
    "Try Test Engine in the preferences.": "请在偏好设置中试用“测试引擎”。",
    "The engine crashed in the {stage} job ({how}).": "引擎在 {stage} 任务中崩溃（{how}）。",
    "Most likely memory ran out: use a smaller preset, or fewer threads.": "很可能是内存不足：请使用更小的预设或更少的线程。",
    "Its log tells more.": "其日志有更多信息。",
    "The {stage} job did not stop by itself and was ended ({how}).": "{stage} 任务没有自行停止，已被结束（{how}）。",
    "The {stage} job was cancelled.": "{stage} 任务已取消。",
    "{folder} was taken away while the {stage} job ran.": "{stage} 任务运行时 {folder} 被移走。",
    "Bring the project back and try again.": "请将项目放回原处后重试。",
    "The engine ended before it answered.": "引擎在应答之前就结束了。",
    "Try again.": "请重试。",
    "No KaRF job is running.": "没有正在运行的 KaRF 任务。",
    "KaRF is busy: {title}.": "KaRF 正忙：{title}。",
    "Wait for it, or cancel it.": "请等待其完成，或将其取消。",
    "Internal error: {error}.": "内部错误：{error}。",
    "The console shows where.": "控制台显示了出错位置。",
    "The log in {job} is empty, or gone.": "{job} 中的日志为空或已不在。",
    "Run the step again.": "请重新运行此步骤。",
    "Blender is rendering.": "Blender 正在渲染。",
    "Wait until it is done, or cancel it.": "请等待其完成，或将其取消。",
    # --- marks
    "Clicks need the engine.": "点击需要引擎。",
    "No masks are chosen.": "没有选择遮罩。",
    "Give a folder with <object>/<photo name>.png, or paint one.": "请指定含有 <物体>/<照片名>.png 的文件夹，或绘制一个。",
    "There is no object to mark.": "没有要标记的物体。",
    "Add one in the KaRF panel.": "请在 KaRF 面板中添加一个。",
    "There is no active object.": "没有活动物体。",
    "Select a mesh or an Empty in the 3D View.": "请在 3D 视图中选择网格或空物体。",
    "Select a mesh, or an Empty for its box.": "请选择网格，或选择空物体以使用其盒子。",
    "Select a mesh with a volume.": "请选择有体积的网格。",
    "{name} is neither a mesh nor an Empty.": "{name} 既不是网格也不是空物体。",
    "{name} surrounds nothing.": "{name} 没有包围任何空间。",
    "No view has a mark of this object yet.": "还没有视图标记过此物体。",
    "Mark it in this one.": "请在此视图中标记它。",
    "No view is suggested.": "没有建议的视图。",
    "Segment first.": "请先分割。",
    # --- swatches
    "There is no palette yet.": "还没有调色板。",
    "Extract the palettes first.": "请先提取调色板。",
    "Extract the palettes again.": "请重新提取调色板。",
    "The scene has no object {name}.": "场景中没有物体 {name}。",
    "Objects: {known}.": "物体：{known}。",
    "Object {name} has no swatch {index}.": "物体 {name} 没有色板 {index}。",
    "Swatches count from 1 to {count}; black is frozen.": "色板从 1 数到 {count}；黑色是固定的。",
    "Swatch {index} of {name} is locked.": "{name} 的色板 {index} 已锁定。",
    "Unlock it in its menu.": "请在其菜单中解锁。",
    "Swatch {index} of {name} is merged into {merged}.": "{name} 的色板 {index} 已合并到 {merged}。",
    "Split that one in its menu.": "请在其菜单中将其拆分。",
    "Swatch {index} of {name} cannot be linked with that.": "{name} 的色板 {index} 不能与它关联。",
    "Swatch {index} of {name} cannot be merged into {other}.": "{name} 的色板 {index} 不能合并到 {other}。",
    "Choose another swatch.": "请选择另一个色板。",
    "Choose another swatch of this object that is shown.": "请选择此物体的另一个已显示的色板。",
    "A color that was added to {name} is locked.": "添加到 {name} 的一个颜色已锁定。",
    "Swatch {index} of {name} was added: it cannot be merged.": "{name} 的色板 {index} 是添加的：不能合并。",
    "Swatch {index} of {name} was learned: it stays.": "{name} 的色板 {index} 是学习到的：它会保留。",
    "Remove it in its menu.": "请在其菜单中移除它。",
    "Remove one of them in its menu.": "请在其菜单中移除其中一个。",
    "Merge it into another in its menu.": "请在其菜单中将其合并到另一个。",
    "{name} is not there in {view}.": "{view} 中没有 {name}。",
    "Click on it in the picture.": "请在画面中点击它。",
    "{count} colors were added to {name}.": "{name} 已添加 {count} 个颜色。",
    "Swatch {index} of {name} was added: nothing is merged into it.": "{name} 的色板 {index} 是添加的：不能合并到它。",
    "No Image Editor shows the recolored picture.": "没有图像编辑器显示重新着色的画面。",
    "Open one, and press Show in step 6.": "请打开一个，并按第 6 步的“显示”。",
    "The clipboard has no color.": "剪贴板中没有颜色。",
    "Copy one as #rrggbb; several, with anything between, for all swatches.": (
        "请以 #rrggbb 复制一个颜色；要用于所有色板，请复制多个，之间可有任意字符。"
    ),
    "Edited swatches of {names} are no longer in the palettes. All edits as they were are in {file}; keyframes "
    "wait in the scene's action.": (
        "{names} 的已编辑色板不再在调色板中。原有的全部编辑在 {file} 中；关键帧仍在场景的动作里。"
    ),
    "The edits could not be kept in {file} ({error}), so the palettes stay as they were.": (
        "无法将编辑保存到 {file}（{error}），因此调色板保持原样。"
    ),
    "Make room there, then choose the project again.": "请在那里腾出空间，然后重新选择项目。",
    "{file} (edit planes) does not exist.": "{file}（编辑平面）不存在。",
    "{file} (edit planes) was made from other palettes.": "{file}（编辑平面）由其他调色板生成。",
    "{file} was made for other palettes.": "{file} 是为其他调色板制作的。",
    "{file} was made for the objects {objects}.": "{file} 是为物体 {objects} 制作的。",
    "Press Prepare in step 6.": "请按第 6 步的“准备”。",
    # --- match
    "No picture is chosen.": "没有选择图片。",
    "Press Paint Over, or choose a picture of this view.": "请按“在其上绘制”，或选择此视图的图片。",
    "{name} was painted over the view {view}, and {shown} is shown.": "{name} 绘制在视图 {view} 之上，而显示的是 {shown}。",
    "Show {view} in step 6, or paint over this view.": "请在第 6 步显示 {view}，或在此视图上绘制。",
    "{name} has {own_width} x {own_height} pixels, the view {width} x {height}.": (
        "{name} 为 {own_width} x {own_height} 像素，视图为 {width} x {height}。"
    ),
    "Choose a picture of the whole view, of any size.": "请选择整个视图的图片，大小不限。",
    "{name} shows the objects as they are in {view}.": "{name} 中的物体与 {view} 中的一样。",
    "Paint on them, or choose another picture.": "请在物体上绘制，或选择另一张图片。",
    "A picture can be matched where photos are edited.": "只有编辑照片时才能匹配图片。",
    "Set Result to Photo plus change.": "请将“结果”设为“照片加变化”。",
    # --- render, export, compositor
    "There are no frames to export.": "没有要导出的帧。",
    "There are no frames to render.": "没有要渲染的帧。",
    "Give at least one frame.": "请至少给出一帧。",
    "There are no frames in {folder}.": "{folder} 中没有帧。",
    "No frames have been rendered yet.": "还没有渲染任何帧。",
    "Render captured views or a camera's frames first.": "请先渲染拍摄视图或相机的帧。",
    "Render the frames again.": "请重新渲染这些帧。",
    "The pictures are in {folder}.": "图片在 {folder} 中。",
    "The frames are in {folder}.": "帧在 {folder} 中。",
    "The layers are in {path}.": "图层在 {path} 中。",
    "The splats are in {path}.": "泼溅在 {path} 中。",
    "There are no axes {axes}.": "没有坐标轴 {axes}。",
    "Use one of: {known}.": "请使用其中之一：{known}。",
    "The points are in {path}.": "点在 {path} 中。",
    "How the engine sees the view is in {folder}.": "引擎所见的此视图在 {folder} 中。",
    "Colorways, their table and a contact sheet are in {out}.": "配色方案、其表格和联系表在 {out} 中。",
    "The view transform {transform} changes colors: Standard shows them as they are.": (
        "视图变换 {transform} 会改变颜色：“标准”按原样显示颜色。"
    ),
    "The compositor recolors {path} by the node {name}.": "合成器用节点 {name} 为 {path} 重新着色。",
    "The compositor's output has other nodes: link {name} where you want it.": "合成器的输出已有其他节点：请将 {name} 连接到所需位置。",
    "Blender knows no color space {name}: choose the one of {path} at its image node.": (
        "Blender 没有色彩空间 {name}：请在图像节点上选择 {path} 的色彩空间。"
    ),
    "The layers have {width} x {height} pixels, the scene renders {own_width} x {own_height}.": (
        "图层为 {width} x {height} 像素，场景渲染 {own_width} x {own_height}。"
    ),
    "The swatches of {names} are of other palettes than the {what}: the sockets begin as learned. Choose the "
    "project anew in step 1 to bring its palettes, then build again.": (
        "{names} 的色板与 {what} 属于不同的调色板：插口从学习到的颜色开始。请在第 1 步重新选择项目以引入其调色板，然后重新构建。"
    ),
    "Colors that were added to {names} are not in the {what}: build again to have them there.": (
        "添加到 {names} 的颜色不在 {what} 中：请重新构建以将其加入。"
    ),
    "{path} has no layer {layer}.": "{path} 没有图层 {layer}。",
    "Render the layers again.": "请重新渲染图层。",
    "The scene is not shown in 3D yet.": "尚未在 3D 中显示场景。",
    "Press Show in 3D View first.": "请先按“在 3D 视图中显示”。",
    "Points alone are shown by no program that reads USD.": "没有读取 USD 的程序能单独显示点。",
    "This Blender cannot write points to glTF.": "此 Blender 无法将点写入 glTF。",
    "Choose quads, or write a PLY file.": "请选择四边面，或写入 PLY 文件。",
    "{path} has an ending that is not known.": "{path} 的扩展名未知。",
    "Give one of {endings}.": "请给出其中之一：{endings}。",
    "This Blender has no exporter of {suffix} files.": "此 Blender 没有 {suffix} 文件的导出器。",
    "Enable it, or choose another ending.": "请启用它，或选择另一个扩展名。",
    "Live Camera needs a window.": "“实时相机”需要窗口。",
    "Write a picture instead: steps.preview_camera.": "请改为写入图片：steps.preview_camera。",
    # --- the engine's
    "{path} does not exist.": "{path} 不存在。",
    "Give the capture's folder or its camera file.": "请给出拍摄的文件夹或其相机文件。",
    "{path} is not a capture of a known format.": "{path} 不是已知格式的拍摄。",
    "A capture has one of these: {markers}.": "拍摄含有以下之一：{markers}。",
    "{path}: none of its {count} photos was found, the first are {first}.": "{path}：其 {count} 张照片均未找到，最先的是 {first}。",
    "Put the photos into {folder}.": "请将照片放入 {folder}。",
    "Put the photos below {folder}, or write each file_path relative to that folder.": (
        "请将照片放在 {folder} 之下，或让每个 file_path 相对于该文件夹。"
    ),
    "{path} has {count} training photos.": "{path} 有 {count} 张训练照片。",
    "A scene needs at least three.": "场景至少需要三张。",
    "{path} is empty.": "{path} 是空的。",
    "Copy the picture again.": "请重新复制该图片。",
    "{path} cannot be read as a picture: {reason}.": "无法将 {path} 作为图片读取：{reason}。",
    "Export or copy the picture again.": "请重新导出或复制该图片。",
    "{path} is a Git-LFS pointer, not a picture.": "{path} 是 Git-LFS 指针，而不是图片。",
    "Fetch the pictures with: git lfs pull.": "请用 git lfs pull 获取图片。",
    "{path} ({what}) is broken JSON at line {line}: {reason}.": "{path}（{what}）的 JSON 在第 {line} 行损坏：{reason}。",
    "Export or write the file again.": "请重新导出或写入该文件。",
    "All photos are transparent everywhere.": "所有照片完全透明。",
    "Export them with their colors, or without alpha.": "请带颜色或不带 Alpha 导出它们。",
    "The computer ran out of memory.": "计算机内存不足。",
    "Lower geometry.long_side, or close other programs.": "请降低 geometry.long_side，或关闭其他程序。",
    "The device has too little memory even for a {parts}th of the batch.": "设备内存连批次的 {parts} 分之一都不够。",
    "Use the CPU.": "请使用 CPU。",
    "Training diverged at iteration {iteration}: loss {loss}.": "训练在第 {iteration} 次迭代时发散：损失 {loss}。",
    "Lower the learning rate.": "请降低学习率。",
    "The geometry stage found nothing solid in the scene.": "几何阶段在场景中没有找到任何实体。",
    "Check the camera poses, or raise the iterations.": "请检查相机位姿，或增加迭代次数。",
    "The {stage} stage was cancelled.": "{stage} 阶段已取消。",
    "What is finished and what is learned so far is kept; start it again when you like.": (
        "已完成的和目前学到的都已保留；可随时重新开始。"
    ),
    "{folder} is in use by {name}.": "{folder} 正被 {name} 使用。",
    "Wait for that job or cancel it.": "请等待该任务，或将其取消。",
    "{folder} already holds a project of {known}.": "{folder} 已有 {known} 的项目。",
    "Choose another folder for {capture}.": "请为 {capture} 选择另一个文件夹。",
    "{folder} is not a KaRF project (project.json is missing).": "{folder} 不是 KaRF 项目（缺少 project.json）。",
    "Give the folder that the geometry stage wrote.": "请给出几何阶段写入的文件夹。",
    "{folder} has no finished {stage} stage.": "{folder} 没有已完成的 {stage} 阶段。",
    "Run the {stage} stage first.": "请先运行 {stage} 阶段。",
    "{path} is {state}: it is not what the {stage} stage wrote.": "{path} 已损坏或缺失（{state}）：它不是 {stage} 阶段写入的内容。",
    "Run the {stage} stage again; what is intact is kept.": "请重新运行 {stage} 阶段；完好的部分会保留。",
    "{path} is damaged ({kind}: {error}).": "{path} 已损坏（{kind}：{error}）。",
    "{folder} is not a folder of masks.": "{folder} 不是遮罩文件夹。",
    "{folder} holds no masks.": "{folder} 中没有遮罩。",
    "{path} marks nothing of {name}.": "{path} 没有标记 {name} 的任何部分。",
    "Paint the object white.": "请将物体涂成白色。",
    "{path} is {width}x{height} pixels where its photo has {expected_width}x{expected_height}.": (
        "{path} 为 {width}x{height} 像素，而其照片为 {expected_width}x{expected_height}。"
    ),
    "Save the mask at the photo's size.": "请按照片的大小保存遮罩。",
    "{path} and {other} mark the same photo.": "{path} 和 {other} 标记的是同一张照片。",
    "Keep one of them.": "请保留其中一个。",
    "{path} is named after no photo.": "{path} 的名称不对应任何照片。",
    "Nothing in the scene belongs to {name}.": "场景中没有任何部分属于 {name}。",
    "Mark it more generously, or in another view.": "请更宽松地标记它，或在另一个视图中标记。",
    "The segmentation has no surface points of {names}.": "分割结果中没有 {names} 的表面点。",
    "Mark it in another photo, or check that its mask covers it.": "请在另一张照片中标记它，或检查其遮罩是否覆盖它。",
    "Add one, or choose one in its properties.": "请添加一个，或在其属性中选择一个。",
    "An orthographic view cannot be rendered.": "无法渲染正交视图。",
    "Look in perspective: View > Perspective.": "请使用透视：视图 > 透视。",
    "The render was cancelled.": "渲染已取消。",
    "The learned scene shows nothing solid.": "学习到的场景没有显示任何实体。",
    "The learned scene shows nothing solid in any photo.": "学习到的场景在任何照片中都没有显示实体。",
    "Learn it again, with other settings.": "请用其他设置重新学习。",
    "An object without pixels has no palette.": "没有像素的物体没有调色板。",
    "Check its masks and the segmentation.": "请检查其遮罩和分割。",
    "The source color is black, so its shading cannot be told.": "源颜色是黑色，因此无法判断其明暗。",
    "Pick a lit spot of the object.": "请拾取物体上受光的位置。",
    "Nothing says where the object is.": "没有说明物体在哪里。",
    "Draw a box or a lasso around it, or click on it.": "请在其周围画框或套索，或点击它。",
    "Only {registered} of the {count} photos of {path} could be placed.": "{path} 的 {count} 张照片中只有 {registered} 张能够定位。",
    "Take more photos with more overlap (everything in at least three of them), of a scene that has texture and stands "
    "still, sharp and without zooming.": (
        "请拍摄更多重叠更大的照片（每处至少出现在三张中），场景须有纹理且静止，照片须清晰且不变焦。"
    ),
    "{path} holds {count} photos; poses need at least {fewest}.": "{path} 有 {count} 张照片；位姿至少需要 {fewest} 张。",
    "{path} is not a video that can be read.": "{path} 不是可读取的视频。",
    "Give a folder of photos, or an MP4 video.": "请给出照片文件夹或 MP4 视频。",
    "A volume of {name} is flat: nothing is inside of it.": "{name} 的一个体积是扁平的：其中没有任何东西。",
    "Give its mesh a depth.": "请让其网格有厚度。",
    "The engine's Python ({executable}) has no package {name}.": "引擎的 Python（{executable}）没有软件包 {name}。",
    "Install it there: {executable} -m pip install {package}": "请在那里安装：{executable} -m pip install {package}",
    "No color book is chosen.": "尚未选择色卡。",
    "Choose one in a swatch's menu, or in the preferences.": "请在色板的菜单或偏好设置中选择一本。",
    "{path} is no color book.": "{path} 不是色卡。",
    "Choose a file of: {kinds}.": "请选择以下类型的文件：{kinds}。",
    "{book} has no color {name}.": "{book} 没有颜色 {name}。",
    "Its nearest name is {near}.": "最接近的名称是 {near}。",
    "{path} has {count} colors.": "{path} 有 {count} 个颜色。",
    "Choose a book of 1 to {most}.": "请选择有 1 到 {most} 个颜色的色卡。",
    "{where} has no {what}.": "{where} 没有 {what}。",
    "A row has the column name, and hex, or L, a and b.": "每一行要有列 name，以及 hex，或 L、a 和 b。",
    "A look's name is empty.": "造型的名称为空。",
    "Choose another name.": "请选择另一个名称。",
    "Colors of {names} in the look {look} are no longer in the palettes. The look as it was is in {file}.": "造型 {look} 中 {names} 的颜色已不在调色板中。原来的造型在 {file}。",
    "Keep one first.": "请先保存一个。",
    "Keep two looks to flip between them.": "请保存两个造型以便在其间切换。",
    "Looks: {known}.": "造型：{known}。",
    "Name it.": "请命名。",
    "Remove it, and keep it again.": "请移除后重新保存。",
    "The look {name} is no edit: {error}.": "造型 {name} 不是编辑：{error}。",
    "The scene has no look {name}.": "场景中没有造型 {name}。",
    "The scene has no looks.": "场景中没有造型。",
    "There is no other look.": "没有其他造型。",
    "{new} and the look {taken} would share a folder.": "{new} 与造型 {taken} 会共用一个文件夹。",
}
