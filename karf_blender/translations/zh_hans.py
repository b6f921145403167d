"""What the extension shows, in simplified Chinese."""

TEXTS = {
    # --- steps and their states
    "1  Import": "1  导入",
    "2  Learn Scene": "2  学习场景",
    "3  Mark Objects": "3  标记物体",
    "4  Segment": "4  分割",
    "5  Palette": "5  调色板",
    "6  Edit": "6  编辑",
    "7  Render": "7  渲染",
    "done": "完成",
    "stale": "已过期",
    "running": "运行中",
    "cancelled": "已取消",
    "Starting": "正在启动",
    "Stopping": "正在停止",
    "Marks have changed since: segment again.": "标记在此之后有改动：请重新分割。",
    "The scene was learned anew since: segment again.": "场景在此之后重新学习过：请重新分割。",
    "The objects were segmented anew since: extract the palettes again.": "物体在此之后重新分割过：请重新提取调色板。",
    "Learned with another preset: learn the scene again to follow this one.": "学习时用的是另一个预设：要采用此预设，请重新学习场景。",
    "Learned from another NeRF, or none: learn the scene again to follow this one.": (
        "学习时用的是另一个 NeRF 或没有用 NeRF：要采用此文件，请重新学习场景。"
    ),
    # --- status
    "No job is running": "没有正在运行的任务",
    "The project folder is missing": "项目文件夹不见了",
    "Bring it back, choose where it is now, or import the capture again.": "请将它放回原处，选择它现在的位置，或重新导入拍摄。",
    "Why, and What to Do": "原因与解决办法",
    "No Messages": "没有消息",
    "Messages": "消息",
    "Messages: {count}": "消息：{count} 条",
    "{what} failed": "{what}失败",
    "{percent}, {count} min left": "{percent}，剩余 {count} 分钟",
    "{percent}, {count} s left": "{percent}，剩余 {count} 秒",
    "All that the last job has said, and what to do where it failed or the project is gone": (
        "上一个任务的全部消息，以及任务失败或项目丢失时的解决办法"
    ),
    "Cancel": "取消",
    "Close this message": "关闭此消息",
    "Dismiss": "关闭",
    "Stop the running job at its next safe point; running the step again resumes where it stood": (
        "在下一个安全点停止正在运行的任务；再次运行此步骤会从停下处继续"
    ),
    "Copy Report": "复制报告",
    "Open Log": "打开日志",
    "KaRF log": "KaRF 日志",
    "Copy versions, how the job ended and the end of its log, to send to a developer; your names are left out": (
        "复制版本、任务的结束方式和日志末尾，以便发给开发者；不包含您的姓名"
    ),
    "Show the end of the failed job's log in a Text Editor": "在文本编辑器中显示失败任务的日志末尾",
    "No job has failed": "没有失败的任务",
    "The report is on the clipboard": "报告已复制到剪贴板",
    "What the last task warned of, a line each": "上一个任务的警告，每行一条",
    "Folder of the failed job, where its log tells more of why": "失败任务的文件夹，其中的日志说明了更多原因",
    "KaRF is busy: wait for the running job, or cancel it": "KaRF 正忙：请等待正在运行的任务，或将其取消",
    "Open": "展开",
    # --- the render engine
    "Any View": "任意视角",
    "Rendered View": "渲染视图",
    "Show the recolored scene in the 3D Views from wherever one looks, and let F12 render it: render engine KaRF": (
        "在 3D 视图中从任意位置显示重新着色的场景，并让 F12 渲染它：渲染引擎 KaRF"
    ),
    "Over Scene": "置于场景中",
    "Let renders show the objects of this file within the captured scene, each hidden where the other is nearer": (
        "让渲染把此文件的物体显示在拍摄的场景之中，较近者遮挡较远者"
    ),
    "The recolored scene from any camera.": "任意相机看到的重新着色的场景。",
    "What the render engine KaRF writes beside the picture.": "渲染引擎 KaRF 在图像之外写入的内容。",
    "Passes": "通道",
    "Depth": "深度",
    "Cryptomatte": "Cryptomatte",
    "Levels": "层级",
    "A pass for each swatch: how much of every pixel changes with it, from 0 to 1": (
        "每个色板一个通道：每个像素随它变化的程度，从 0 到 1"
    ),
    # --- workspace
    "KaRF Workspace": "KaRF 工作区",
    "Go to the KaRF workspace: 3D View, Image Editor and timeline, both sidebars at the KaRF tab. It is added to the "
    "file the first time. What is imported is ready to mark there": "转到 KaRF 工作区：3D 视图、图像编辑器和时间线，"
    "两个侧栏都停在 KaRF 选项卡。首次使用时会加入文件。已导入的拍摄可以在那里直接标记",
    # --- 1 import
    "Import Capture": "导入拍摄",
    "Make a camera for every photo of a capture (its folder or camera file): transforms.json, COLMAP or LLFF": (
        "为拍摄（其文件夹或相机文件）的每张照片创建一个相机：transforms.json、COLMAP 或 LLFF"
    ),
    "Find Camera Poses": "求解相机位姿",
    "Find the camera poses of a folder of photos, or of a video, and import the capture that they make": (
        "求解一个照片文件夹或一段视频的相机位姿，并导入由此得到的拍摄"
    ),
    "KaRF capture": "KaRF 拍摄",
    "Camera files may be dropped on the 3D View; what else ends so is refused with a sentence when it is read.": (
        "可将相机文件拖放到 3D 视图；同样后缀的其他文件在读取时会被拒绝并说明原因。"
    ),
    "{count} cameras from {path}": "从 {path} 导入了 {count} 个相机",
    "Import a capture first": "请先导入拍摄",
    "The project folder {path} is missing: bring it back, or choose it in step 1": (
        "项目文件夹 {path} 不见了：请放回原处，或在步骤 1 中选择它"
    ),
    "Orientation": "朝向",
    "Automatic": "自动",
    "Upright where the capture's world is arbitrary (COLMAP, LLFF), else as in the file": (
        "拍摄的坐标系任意时（COLMAP、LLFF）摆正，否则与文件一致"
    ),
    "As in File": "与文件一致",
    "Keep the capture's own axes": "保留拍摄自身的坐标轴",
    "Upright": "摆正",
    "Turn what the cameras have above them upwards": "让相机上方的方向朝上",
    "Size": "大小",
    "Scale the rig so that its cameras are spread over this length; 0: as in the file": (
        "缩放相机组，使各相机分布在此长度内；0：与文件一致"
    ),
    "Sparse Points": "稀疏点",
    "Show the points that the photos share": "显示各照片共有的点",
    "Photos": "照片",
    "Show the photos behind the cameras": "在相机后方显示照片",
    "Camera Size": "相机大小",
    "Drawn size of the cameras, of the length that they are spread over": "相机的绘制大小，占其分布长度的百分比",
    "Project": "项目",
    "Empty: beside the .blend": "留空：在 .blend 文件旁",
    "Folder of all that is learned; choosing one that has palettes brings its swatches": (
        "保存全部学习结果的文件夹；选择已有调色板的文件夹会带来其色板"
    ),
    "The project shall not move beside the file: it was asked": "项目不移到文件旁：已询问过",
    "Move Project Beside File": "将项目移到文件旁",
    "Open this folder in the system's file manager": "在系统的文件管理器中打开此文件夹",
    "Open Folder": "打开文件夹",
    "What was rendered last": "最近渲染的内容",
    "All that is learned": "全部学习结果",
    "Where pictures go": "画面存放处",
    "Move the project out of the extension's own folder, beside the .blend, so that both can be shared; the file is saved": "将项目从扩展自身的文件夹移到 .blend 旁，以便一起共享；文件会被保存",
    "Save the file first": "请先保存文件",
    "The project is the file's own": "项目已在文件旁",
    "Move the project beside the file?": "将项目移到文件旁？",
    "Move": "移动",
    "What is learned lies in the extension's own folder.": "学习结果位于扩展自身的文件夹中。",
    "Beside the file it goes along when that is shared or kept.": "放在文件旁，共享或保存文件时会一同带上。",
    "The project is in {path}": "项目位于 {path}",
    "Capture": "拍摄",
    "Cameras and photos": "相机与照片",
    "View": "视图",
    "Views": "视图",
    "The captured view that is shown": "显示的拍摄视图",
    "The captured view of this camera": "此相机对应的拍摄视图",
    "KaRF view": "KaRF 视图",
    "Hidden by KaRF": "由 KaRF 隐藏",
    "Rig": "相机组",
    "The Empty that holds the captured cameras": "容纳各拍摄相机的空物体",
    "Points": "点",
    "Sparse points of the capture": "拍摄的稀疏点",
    "Split": "划分",
    "train, val or test": "train、val 或 test",
    "Check Capture": "检查拍摄",
    "Look for blurred photos, drifting exposure, holes and poor poses before anything is learned, and show where more photos would help": (
        "在学习之前查找模糊的照片、漂移的曝光、视角空缺和不佳的位姿，并显示在哪里补拍照片会有帮助"
    ),
    "What the engine says of the capture, a line each; empty: it was not checked": "引擎对拍摄的评价，每行一条；为空：未检查",
    "Whether the engine advises to take more photos before it is learned": "引擎是否建议在学习之前补拍照片",
    "Look Through": "透过相机查看",
    "Look through the active view's camera, with its photo's size as the scene's until the view is left": (
        "透过当前视图的相机查看；在离开视图之前，场景采用其照片的尺寸"
    ),
    "Leave View": "离开视图",
    "Give the scene the camera and the picture size back that it had before a captured camera was looked through": (
        "恢复透过拍摄相机查看之前场景的相机和画面尺寸"
    ),
    "No captured camera is looked through": "当前没有透过拍摄相机查看",
    "Looking Through": "正在透过查看",
    "Hide Others": "隐藏其他",
    "Hide the other cameras and the sparse points while one camera is looked through": (
        "透过一个相机查看时隐藏其他相机和稀疏点"
    ),
    "Picture": "画面",
    "Picture Before": "之前的画面",
    "Empty: the active view": "留空：当前视图",
    "Reprojection Errors": "重投影误差",
    "Over the photo looked through: lines from the sparse points to where the photo shows them, green where they "
    "agree, red from 4 pixels on": "在所查看的照片上：从稀疏点到照片中其所在位置的连线，吻合处为绿色，4 像素起为红色",
    "No sparse points to check cameras by": "没有可用来检查相机的稀疏点",
    "Look through a view to see its errors": "透过某个视图查看以显示其误差",
    "No point is known to be in this photo": "已知没有点在此照片中",
    # --- 2 learn
    "Learn Scene": "学习场景",
    "Learn the scene's geometry from the photos": "从照片学习场景的几何",
    "Learn All": "全部学习",
    "Learn the scene, segment the marked objects, extract their palettes, and show the active view: steps 2, 4 and 5 "
    "in a row. What is learned already is kept": (
        "学习场景、分割已标记的物体、提取其调色板并显示当前视图：依次完成步骤 2、4 和 5。已学习的内容会保留"
    ),
    "Preset": "预设",
    "How long and how well to learn": "学习的时长与质量",
    "Demo": "演示",
    "Fast": "快速",
    "Fine": "精细",
    "Quality": "高质量",
    "Paper": "论文",
    "For a first look: photos of 256 pixels, on any computer": "初步查看：256 像素的照片，任何电脑均可",
    "Photos of 400 pixels, on a laptop": "400 像素的照片，笔记本电脑",
    "Photos of 400 pixels with voxels half as large, on a laptop with 8 GB of memory": (
        "400 像素的照片，体素缩小一半，8 GB 内存的笔记本电脑"
    ),
    "Photos of 800 pixels, on a graphics card": "800 像素的照片，需要显卡",
    "The paper's own method and numbers, on a graphics card, for a long time": "论文自身的方法和参数，需要显卡，耗时很长",
    "About a minute on this computer": "在此电脑上约 1 分钟",
    "About {count} minutes on this computer": "在此电脑上约 {count} 分钟",
    "About {count} hours on this computer": "在此电脑上约 {count} 小时",
    "Pretrained NeRF": "预训练 NeRF",
    "Checkpoint of a NeRF that another program has trained on this capture, taken as the geometry (nerf-pytorch, "
    "krrish94); empty: learn it": (
        "其他程序用此拍摄训练的 NeRF 检查点，直接作为几何使用（nerf-pytorch、krrish94）；留空：自行学习"
    ),
    "Keep for Testing": "留作测试",
    "Keep every so many-th photo out of learning, to measure quality with; 0: learn from all. Where the capture "
    "declares its test photos, those are kept out; a marked photo is learned from in any case": (
        "每隔若干张照片留出一张不参与学习，用来衡量质量；0：全部参与学习。拍摄自带测试照片时留出的是那些；已标记的照片总会参与学习"
    ),
    "Every how many-th photo is not learned from; -1: as was learned": "每隔多少张照片留出一张；-1：与已学习的一致",
    "Engine: {what}": "引擎：{what}",
    "KaRF Preferences": "KaRF 偏好设置",
    "Learn the scene first": "请先学习场景",
    "Mark an object first: paint a mask, or choose a folder of masks": "请先标记物体：绘制遮罩，或选择遮罩文件夹",
    # --- 3 mark
    "Object": "物体",
    "Add Object": "添加物体",
    "Add an object first": "请先添加物体",
    "Add an object to mark; double-click its name to change it": "添加要标记的物体；双击名称可修改",
    "Remove Object": "移除物体",
    "Remove the object?": "移除此物体？",
    "Remove the object with all its masks and corrections; undo brings them back": (
        "移除物体及其全部遮罩和校正；撤销可恢复"
    ),
    "Also that of its folder of masks and of its swatches": "也是其遮罩文件夹和色板的名称",
    "The name of its folder: the name, until that is changed": "其文件夹的名称：在修改之前与名称相同",
    "Of its color, which stays when it is renamed; -1: none yet": "其颜色的编号，重命名时保持不变；-1：尚无",
    "The object that is being marked": "正在标记的物体",
    "The photo that is marked": "正在标记的照片",
    "The number of the last stroke, which undo takes back": "最后一笔的编号，撤销时会收回",
    "not marked": "未标记",
    "Marked": "已标记",
    "Only views in which the object is marked": "仅限已标记该物体的视图",
    "Next View": "下一视图",
    "1: the next view; -1: the one before": "1：下一视图；-1：上一视图",
    "Make the next or the previous view the active one": "将下一个或上一个视图设为当前视图",
    "Mark in Photo": "在照片中标记",
    "Mark: Box": "标记：框",
    "Mark: Brush": "标记：笔刷",
    "Mark: Click": "标记：点击",
    "Mark: Lasso": "标记：套索",
    "Brush": "笔刷",
    "Radius": "半径",
    "Radius on the screen": "屏幕上的半径",
    "Does": "作用",
    "Add": "添加",
    "Take Away": "去除",
    "Clear": "清除",
    "Correct": "校正",
    "This is the object": "这是物体",
    "This is not the object": "这不是物体",
    "Of a correction: say nothing here; of a mask: as Take Away": "校正时：此处不作说明；遮罩时：与去除相同",
    "Strokes say where the segmentation is wrong, in any view: this is the object, this is not": (
        "在任意视图中用笔触指出分割错误之处：这是物体，这不是"
    ),
    "Click on the object, and where it is not with Ctrl or Alt; the engine finds it": (
        "点击物体，按住 Ctrl 或 Alt 点击不是物体的地方；引擎会找到它"
    ),
    "Click on the object: the engine finds it, and later clicks refine. Ctrl or Alt: this is not the object": (
        "点击物体：引擎会找到它，后续点击逐步完善。Ctrl 或 Alt：这不是物体"
    ),
    "Drag a box around the object; the engine finds it there": "在物体周围拖出一个框；引擎会在其中找到它",
    "Drag a box around the object: the engine finds it there. Ctrl: all in the box is not the object": (
        "在物体周围拖出一个框：引擎会在其中找到它。Ctrl：框内都不是物体"
    ),
    "Draw around the object, or with Ctrl around what it is not": "沿物体周围绘制，按住 Ctrl 则沿不是物体的部分绘制",
    "Draw around the object. Ctrl: what is surrounded is not the object": "沿物体周围绘制。Ctrl：圈住的不是物体",
    "Paint over the object, and erase with Ctrl": "涂抹物体，按住 Ctrl 擦除",
    "Paint over the object. Ctrl: erase, or say that this is not the object; Shift: leave a correction unsaid again": (
        "涂抹物体。Ctrl：擦除，或说明这不是物体；Shift：收回此处的校正"
    ),
    "Show the active view's photo in the Image Editors and take up a tool to mark it: click, box, lasso or brush": (
        "在图像编辑器中显示当前视图的照片，并选用标记工具：点击、框、套索或笔刷"
    ),
    "Open an Image Editor: the photo is marked there": "请打开图像编辑器：照片在那里标记",
    "Without the engine a box is a rectangle, and clicks do nothing.": "没有引擎时，框只是矩形，点击不起作用。",
    "Erase Mask": "擦除遮罩",
    "Erase Correction": "擦除校正",
    "Erase the object's mask in the active view, or all that corrects it there": "擦除当前视图中该物体的遮罩或其全部校正",
    "Masks": "遮罩",
    "Folder with <object>/<photo name>.png, white where the object is": "含 <物体>/<照片名>.png 的文件夹，物体处为白色",
    # --- 4 segment, 5 palette
    "Segment": "分割",
    "Turn the coarse masks into clean ones in every view": "将粗略遮罩变为每个视图中的精确遮罩",
    "Segment the objects first": "请先分割物体",
    "Extract Palette": "提取调色板",
    "Find the swatches of every object and learn what each pixel takes from them. Edits, locks and keyframes stay with "
    "their object and color; edits whose color is no longer there are kept in the project's folder edits": (
        "找出每个物体的色板，并学习每个像素从中取用多少。编辑、锁定和关键帧随其物体和颜色保留；颜色已不存在的编辑保存在项目的 "
        "edits 文件夹中"
    ),
    "Learn Splats": "学习高斯泼溅",
    "Learn the scene as Gaussian splats too: cameras that took no photo then see it sharply, in a fraction of the time": (
        "同时将场景学习为高斯泼溅：未拍过照片的相机也能清晰看到场景，用时少得多"
    ),
    "Extract anew?": "重新提取？",
    "Edits follow their object and color; those that find none are kept in the project": (
        "编辑随其物体和颜色保留；找不到对应的编辑保存在项目中"
    ),
    "Extract the palettes first": "请先提取调色板",
    # --- 6 edit
    "Swatches appear after step 5": "色板在步骤 5 之后出现",
    "Show": "显示",
    "Prepare": "准备",
    "{view} is not prepared: Prepare shows it recolored": "{view} 尚未准备：按“准备”显示其重新着色的结果",
    "Open an Image Editor to see it": "打开图像编辑器即可查看",
    "Show View": "显示视图",
    "Show a captured view with the swatches as they stand; the engine prepares it the first time": (
        "按当前色板显示拍摄视图；首次由引擎准备"
    ),
    "Prepare Views": "准备视图",
    "Prepare All Views": "准备所有视图",
    "Prepare all captured views, so that each shows at once": "准备所有拍摄视图，使每个都能立即显示",
    "Look at View": "查看视图",
    "Result": "结果",
    "The recolored picture": "重新着色的画面",
    "Compositing": "合成",
    "Photo plus change": "照片加变化",
    "Palette only": "仅调色板",
    "Add the palette's change to the photo: nothing changed leaves the photo as it is": (
        "将调色板的变化加到照片上：没有变化则照片保持原样"
    ),
    "Replace the object by its palette mixture, as in the paper": "与论文一样，用调色板的混合替换物体",
    "Load Edit": "载入编辑",
    "Save Edit": "保存编辑",
    "KaRF edit": "KaRF 编辑",
    "Edit files may be dropped on the recolored picture.": "可将编辑文件拖放到重新着色的画面上。",
    "Set the swatches to those of an edit file, or of a palette of GIMP (.gpl) or Adobe (.ase)": (
        "将色板设为编辑文件或 GIMP (.gpl)、Adobe (.ase) 调色板中的颜色"
    ),
    "Write the swatches to an edit file, for other scenes and scripts, or as a palette (.gpl, .ase)": (
        "将色板写入编辑文件，供其他场景和脚本使用，或写为调色板（.gpl、.ase）"
    ),
    "Reset": "重置",
    "Reset Swatch": "重置色板",
    "Give a swatch, or all of an object, the learned color back": "将一个色板或物体的全部色板恢复为学习到的颜色",
    "Swatch": "色板",
    "From 1; 0: all": "从 1 开始；0：全部",
    "Learned": "学习所得",
    "Unsure": "不确定",
    "Where it is unsure what belongs to an object, in orange": "以橙色显示不确定是否属于物体之处",
    "The color that was found in the photos": "在照片中找到的颜色",
    "Color": "颜色",
    "The color it shall have; it may be brighter than white, which bright paint can need. With Material the other colors of its paint follow, and highlights keep the light's color": "应有的颜色；可以比白色更亮，明亮的颜料可能需要。启用“材质”时，同一涂料的其他颜色随之变化，高光保持光源的颜色",
    "The other colors of a paint follow the swatch that is dragged: shades, pale and dark ones, while highlights keep the light's color. Off: each swatch moves by itself": "拖动色板时，同一涂料的其他颜色（阴影、浅色与深色）随之变化，高光保持光源的颜色。关闭：每个色板单独变化",
    "Last": "上次",
    "The color as of its last change": "上次更改时的颜色",
    "Began": "起始",
    "The color when a swatch of the object began to be dragged": "开始拖动该物体的色板时的颜色",
    "Given": "赋予",
    "The color when that one was dragged last": "上次拖动该色板时的颜色",
    "The number of the swatch that was dragged last; 0: none": "上次拖动的色板编号；0：无",
    "Lock": "锁定",
    "'Becomes' leaves this swatch alone": "“变为”不改动此色板",
    "One color becomes another": "一种颜色变为另一种",
    "Pick a color of the object and what it shall become": "选取物体的一种颜色以及它应变成的颜色",
    "Source": "源颜色",
    "A color of the object as it is in the photo, before any edit; pick it from the picture": (
        "物体在照片中未经编辑的颜色；从画面中拾取"
    ),
    "Target": "目标颜色",
    "The color that the source shall become": "源颜色应变成的颜色",
    "Rule": "规则",
    "Material": "材质",
    "Paint the whole object anew, light and highlights kept": "为整个物体重新上色，保留光照和高光",
    "Fewest swatches": "最少色板",
    "Reach the color with as few changed swatches as possible": "以尽可能少的色板改动达到该颜色",
    "Becomes": "变为",
    "Apply": "应用",
    "Set the object's swatches so that its source color becomes the target color": "设置物体的色板，使源颜色变为目标颜色",
    # --- seeing
    "Before / After": "之前 / 之后",
    "Switch between the edited picture and the original; a key that is held down shows the original until it is let go": (
        "在编辑后的画面和原图之间切换；按住按键时显示原图，松开为止"
    ),
    "Original": "原图",
    "Edited": "编辑后",
    "Render Learned": "渲染学习结果",
    "Render what the engine has learned, from the active view's camera": "从当前视图的相机渲染引擎学习到的内容",
    "What the engine has learned, rendered from here": "引擎学习到的内容，从此处渲染",
    "With the swatches as they stand": "按当前色板",
    "The photo before any edit: pick colors from it": "未经编辑的照片：从中拾取颜色",
    "Weights": "权重",
    "Show Weights": "显示权重",
    "How much of each pixel is one swatch's, white: all": "每个像素有多少来自某一色板，白色：全部",
    "Show where this swatch is used, white where all of a pixel is its, or the object alone; again: back to the picture": "显示此色板用在何处（全白表示像素完全属于它），或只显示该物体；再次点击：回到画面",
    "Whose swatch's weights are shown": "显示哪个物体的色板权重",
    "The swatch whose weights are shown, from 1; 0: the object with all else dimmed": "显示其权重的色板，从 1 开始；0：该物体，其余变暗",
    "From 1; 0: the object, with all else dimmed": "从 1 开始；0：该物体，其余变暗",
    "Difference": "差异",
    "What the edit changes, in CIEDE2000": "编辑造成的变化，以 CIEDE2000 计",
    "What is left is {how} ({number})": "剩余差异{how}（{number}）",
    "invisible": "看不出",
    "visible side by side": "并排时可见",
    "visible": "可见",
    "Right: what the left color becomes": "右侧：左侧颜色将变成的颜色",
    "{name} has no such color: pick it there": "{name} 没有这种颜色：请在其上拾取",
    "Wipe": "擦拭对比",
    "Drag Wipe": "拖动擦拭线",
    "The original on the left of a line": "分界线左侧为原图",
    "Where the line is: 0 is the left border, 1 the right one": "分界线的位置：0 为左边界，1 为右边界",
    "Move the line between the original and the picture with the mouse; a click leaves it there, Esc takes it away": (
        "用鼠标移动原图与画面之间的分界线；点击将其留在原处，Esc 将其移除"
    ),
    "KaRF: Show": "KaRF：显示",
    "Choose what is shown of the active view": "选择显示当前视图的哪种画面",
    "What is shown of the active view": "显示当前视图的哪种画面",
    "What shows the learned scene": "显示学习到的场景的物体",
    "Show Masks": "显示遮罩",
    "Show or hide the objects' masks over the active view, each in its color; the engine makes them the first time": (
        "在当前视图上显示或隐藏各物体的遮罩，每个有自己的颜色；首次由引擎生成"
    ),
    "The objects, each in a color of its own, over the picture": "各物体以各自的颜色叠加在画面上",
    "Press Show Masks for this view": "请对此视图按“显示遮罩”",
    "Tint": "着色强度",
    "How strong the objects' colors are": "物体颜色的强度",
    "Outlines": "轮廓",
    "A line round every object": "每个物体周围的线",
    # --- the scene in 3D
    "Scene in 3D": "3D 场景",
    "Show in 3D View": "在 3D 视图中显示",
    "Show the learned scene as an object whose colors follow the swatches. One that is there already is replaced": (
        "将学习到的场景显示为颜色随色板变化的物体。已有的会被替换"
    ),
    "About how many; ten times as many show finer things, and follow swatches more slowly": (
        "大致数量；十倍的数量能显示更细的部分，但跟随色板更慢"
    ),
    "Show the scene in the 3D View first": "请先在 3D 视图中显示场景",
    "Flat Colors": "平面颜色",
    "Let the 3D Views show colors as they are: Solid mode, flat light, color attributes": (
        "让 3D 视图如实显示颜色：实体模式、平面光照、颜色属性"
    ),
    "Splat": "泼溅",
    "Splat Follows Swatches": "泼溅跟随色板",
    "The object of splats that has the colors of the swatches": "具有色板颜色的高斯泼溅物体",
    "Give the active object, Gaussian splats that Blender or 3DGS Render has imported, the colors of the swatches, now and "
    "whenever they change. Pressed again, it keeps those that it has": (
        "让活动物体（由 Blender 或 3DGS Render 导入的高斯泼溅）现在并随时具有色板的颜色。再按一次则保留现有颜色"
    ),
    "Choose an object of splats that Blender or 3DGS Render has imported": "请选择由 Blender 或 3DGS Render 导入的高斯泼溅物体",
    "Learn splats first": "请先学习高斯泼溅",
    "Export Scene": "导出场景",
    "Write the scene in 3D with its colors as they are now: PLY, glTF (.glb, .gltf) or USD, by the file's ending": (
        "按当前颜色写出 3D 场景：PLY、glTF（.glb、.gltf）或 USD，由文件后缀决定"
    ),
    "Shape": "形状",
    "Quads": "四边面",
    "Small faces, which every viewer of meshes shows": "小面片，任何网格查看器都能显示",
    "One vertex each, for programs that know point clouds": "每点一个顶点，供支持点云的程序使用",
    # --- 7 render
    "This View": "此视图",
    "Render This View": "渲染此视图",
    "Recolor the active view's photo at its own size; without the engine, write the preview that is shown": (
        "按原尺寸为当前视图的照片重新着色；没有引擎时写出所显示的预览"
    ),
    "The picture goes to {path}": "画面写入 {path}",
    "Pictures go to {path}": "画面写入 {path}",
    "Without the engine the preview was written: {path}": "没有引擎，已写出预览：{path}",
    "Captured Views": "拍摄视图",
    "Render Captured Views": "渲染拍摄视图",
    "Recolor the capture's photos with the swatches as they stand": "按当前色板为拍摄的照片重新着色",
    "All": "全部",
    "All captured views": "所有拍摄视图",
    "Learned From": "参与学习的",
    "The views that the scene was learned from": "场景学习所用的视图",
    "Kept for Testing": "留作测试的",
    "The views that were kept out of learning": "未参与学习的视图",
    "Names": "名称",
    "Of single views, with commas; empty: all of those above": "单个视图的名称，以逗号分隔；留空：上面所选的全部",
    "all, train, test or names with commas": "all、train、test，或以逗号分隔的名称",
    "all, train, test, names with commas, or the path of a camera file": (
        "all、train、test、以逗号分隔的名称，或相机文件的路径"
    ),
    "Of recolored photos": "重新着色的照片的",
    "Photo's Size": "照片尺寸",
    "All pixels of the photo, in a file of its kind": "照片的全部像素，存为同类文件",
    "Learned Size": "学习尺寸",
    "As small as what was learned from: quick, for a look": "与学习所用的一样小：快速查看",
    "Long Side": "长边",
    "So many pixels at the longer side": "长边的像素数",
    "Output": "输出",
    "Where pictures go; empty: out in the project": "画面写入的位置；留空：项目中的 out",
    "Fade Unseen": "淡化未见部分",
    "What no photo shows, or only from elsewhere, turns gray in the rendered 3D View and in cameras' frames. Off: "
    "whatever the splats hold there": (
        "没有照片显示、或只从别处显示的部分，在渲染的 3D 视图和摄像机帧中变为灰色。关闭：显示高斯泼溅在那里所含的任何内容"
    ),
    "Seen": "可见程度",
    "A pass of how well photos know what is shown, from 0, where none shows it, to 1; of splats": (
        "一个通道：照片对所显示内容的了解程度，0 表示没有照片显示，1 表示完全了解；用于高斯泼溅"
    ),
    "Skip Existing": "跳过已有",
    "Keep frames that are there already and would come out the same, and go on where a job was stopped": (
        "保留已存在且结果相同的帧，并从任务停下处继续"
    ),
    "Camera": "相机",
    "Camera's Frames": "相机帧",
    "Render Camera's Frames": "渲染相机帧",
    "Recolor what the scene's camera sees, for every frame of the scene; swatches may be keyframed": (
        "对场景的每一帧，为场景相机所见重新着色；色板可以有关键帧"
    ),
    "Resolution X": "分辨率 X",
    "Y": "Y",
    "Frame Start": "起始帧",
    "End": "结束点",
    "Step": "步长",
    "File Format": "文件格式",
    "sRGB numbers, for all other programs": "sRGB 数值，适用于其他所有程序",
    "Scene-linear light, for compositing": "场景线性光，用于合成",
    "Color Depth": "色深",
    "8 bits a channel": "每通道 8 位",
    "16 bits a channel; of OpenEXR half floats": "每通道 16 位；OpenEXR 为半精度浮点",
    "32 bits a channel: full floats": "每通道 32 位：单精度浮点",
    "Opaque": "不透明",
    "What is behind the scene is transparent": "场景之后的部分透明",
    "Of a camera's frames": "相机帧的",
    "Farm Job": "渲染农场任务",
    "Write the scene's frames as a job for a render farm: a folder with all it needs, by Open Job Description": (
        "将场景的各帧写为渲染农场任务：按 Open Job Description 组织、包含所需一切的文件夹"
    ),
    "Folder": "文件夹",
    "New or empty; default: in the output": "新建或空的；默认：在输出中",
    "Where to; a folder of its own, new or empty": "写到哪里；独立的文件夹，新建或空的",
    "Frames a Task": "每任务帧数",
    "How many frames a task renders": "每个任务渲染多少帧",
    "The job is in {path}": "任务在 {path}",
    "Rendered Frames": "已渲染的帧",
    "Frames": "帧",
    "Folder of the frames that were rendered last": "上次渲染的帧所在文件夹",
    "Show Frames": "显示帧",
    "Show the frames that were rendered last in the Image Editor": "在图像编辑器中显示上次渲染的帧",
    "{name} is in the Image Editors": "{name} 已在图像编辑器中",
    "Add Strip": "添加片段",
    "Put the frames that were rendered last into the video sequencer, as one strip": (
        "将上次渲染的帧作为一个片段放入视频序列编辑器"
    ),
    "{name} is on channel {channel} of the sequencer of {scene}": "{name} 位于 {scene} 的序列编辑器的第 {channel} 通道",
    "Render captured views or a camera's frames first": "请先渲染拍摄视图或相机帧",
    "Camera Paths": "相机路径",
    "Import Cameras": "导入相机",
    "Export Cameras": "导出相机",
    "Make one animated camera of the cameras in a transforms.json, a frame each": (
        "由 transforms.json 中的相机生成一个动画相机，每帧一个"
    ),
    "Write the scene's camera, frame by frame over the scene's range, as a transforms.json relative to the rig": (
        "将场景相机在场景帧范围内逐帧写为相对于相机组的 transforms.json"
    ),
    "The scene has no camera": "场景没有相机",
    "Wrote {count} cameras to {path}": "已将 {count} 个相机写入 {path}",
    "Wrote {path}": "已写入 {path}",
    "{name} is the scene's camera": "{name} 是场景的相机",
    "Colorways": "配色方案",
    "Render Colorways": "渲染配色方案",
    "Choose a sheet of colorways (CSV or JSON), see what each color will be, and recolor all views by each": (
        "选择配色表（CSV 或 JSON），查看每种颜色的结果，并按每个方案为所有视图重新着色"
    ),
    "Recolor views by each colorway of a sheet": "按配色表的每个方案为视图重新着色",
    "Wanted": "期望",
    "Reached": "达到",
    "CIEDE2000 of the color reached to the wanted one": "达到的颜色与期望颜色之间的 CIEDE2000",
    "Why the wanted color cannot be reached": "为何无法达到期望的颜色",
    "Cannot be reached, because {reason}": "无法达到，因为 {reason}",
    "{count} colors, {missed} of them cannot be reached. Numbers: difference from the wanted, 1 is just visible": "{count} 种颜色，其中 {missed} 种无法达到。数字：与期望颜色的差异，1 为刚可察觉",
    "Compositor": "合成器",
    "Build Compositor": "构建合成节点",
    "Build, Follow Swatches": "构建并跟随色板",
    "Follow Swatches": "跟随色板",
    "The sockets follow the swatches; else they begin with them, and are set by hand": (
        "插口跟随色板；否则以色板开始，之后手动设置"
    ),
    "Recolor the active view by nodes in the compositor, with a color socket for each swatch": (
        "用合成器节点为当前视图重新着色，每个色板一个颜色插口"
    ),
    "Recolor the active view by nodes in the compositor, with sockets that follow the swatches": (
        "用合成器节点为当前视图重新着色，插口跟随色板"
    ),
    "Recolor the active view by nodes in the compositor, with sockets that are set by hand": (
        "用合成器节点为当前视图重新着色，插口手动设置"
    ),
    "Name of a captured view; empty: the active one": "拍摄视图的名称；留空：当前视图",
    "Name": "名称",
    "Photo": "照片",
    "By": "依据",
    # --- preferences
    "Install Engine": "安装引擎",
    "Make an environment of its own for the engine; a dialog says what will be fetched, from where and where to, and "
    "asks. What is there already is checked, finished, repaired or updated": (
        "为引擎建立独立环境；对话框会说明将获取什么、从哪里、放到哪里，并征求确认。已有的会被检查、补全、修复或更新"
    ),
    "Cancel Installation": "取消安装",
    "Stop installing; what was fetched is kept": "停止安装；已获取的内容会保留",
    "Remove Engine": "移除引擎",
    "Remove the engine?": "移除引擎？",
    "Removing the engine ...": "正在移除引擎……",
    "Delete the engine's environment and all that was fetched for it; projects stay": (
        "删除引擎的环境以及为其获取的一切；项目保留"
    ),
    "The engine is being installed or removed": "引擎正在安装或移除",
    "PyTorch for": "PyTorch 用于",
    "Camera poses of photos without them (pycolmap)": "为没有位姿的照片求解相机位姿 (pycolmap)",
    "Folder of wheels": "wheel 文件夹",
    "Take the packages' files from here, without network": "从这里获取软件包文件，无需网络",
    "Python or uv": "Python 或 uv",
    "A Python, or uv, that makes the environment; empty: Blender's own Python, uv, or any that is found": (
        "用来建立环境的 Python 或 uv；留空：Blender 自带的 Python、uv 或找到的任何一个"
    ),
    "Engine Folder": "引擎文件夹",
    "Where Install Engine puts the engine; empty: Blender's folder for this extension's own files": (
        "“安装引擎”放置引擎的位置；留空：Blender 为此扩展保留的文件夹"
    ),
    "Engine Python": "引擎 Python",
    "The whole path of a Python that has PyTorch, in place of the installed engine; empty: the variable "
    "KARF_ENGINE_PYTHON, else the installed engine": (
        "带有 PyTorch 的 Python 的完整路径，代替已安装的引擎；留空：变量 KARF_ENGINE_PYTHON，否则为已安装的引擎"
    ),
    "Threads": "线程",
    "Threads of the engine; 0: the engine chooses. Give free cores only": "引擎的线程数；0：由引擎选择。只应给出空闲的核心数",
    "Test Engine": "测试引擎",
    "Cancel Test": "取消测试",
    "Testing ...": "正在测试……",
    "A test is running": "测试正在进行",
    "Test the engine first": "请先测试引擎",
    "Ask the engine's Python for its packages, its device and its disk, and try each stage on a tiny scene": (
        "检查引擎 Python 的软件包、设备和磁盘，并在微型场景上试运行每个阶段"
    ),
    "Stop asking the engine's Python": "停止检查引擎的 Python",
    "Copy versions and all that the test has found, to send to a developer; your names are left out": (
        "复制版本和测试的全部结果，以便发给开发者；不包含您的姓名"
    ),
    "Command": "命令",
    "Copy Command": "复制命令",
    "Copy this command, to paste it into a terminal": "复制此命令，以便粘贴到终端",
    "The command is on the clipboard": "命令已复制到剪贴板",
    "The same by hand:": "手动完成同样的操作：",
    # --- swatches
    "A color of the object in the picture as it is, edited or not; pick it there (E)": "物体在当前画面中的颜色，编辑与否均可；在那里拾取 (E)",
    "The color when the source was picked": "拾取源颜色时的颜色",
    "How the photo is exposed in which the source was picked": "拾取源颜色的照片的曝光",
    "The color that Becomes gave it last": "“变为”上次赋予它的颜色",
    "Held": "保持",
    "Colors that its paints were given before, which Becomes keeps": "其涂料此前被赋予的颜色，“变为”会予以保持",
    "Live": "实时",
    "Follow the target color while it is dragged": "拖动目标颜色时随之变化",
    "Surface": "表面",
    "Reset Surface": "重置表面",
    "Give a swatch, or all of an object, saturation, brightness and gloss as in the photos back; locked ones stay": (
        "将一个色板或物体的全部色板的饱和度、亮度和光泽恢复为照片中的样子；锁定的不变"
    ),
    "Saturation, brightness and gloss of each swatch's paint": "每个色板涂料的饱和度、亮度和光泽",
    "Saturation": "饱和度",
    "How vivid its paint is: 1 as it is, 0 gray": "其涂料的鲜艳程度：1 为原样，0 为灰色",
    "Brightness": "亮度",
    "Lighter or darker mid-tones of its paint; black and white stay": "使其涂料的中间调变亮或变暗；黑与白不变",
    "Gloss": "光泽",
    "How strong the highlights on its paint are: 1 as they are, 0 matte": "其涂料上高光的强度：1 为原样，0 为哑光",
    "What surfaces add to the color": "表面在颜色上增加的量",
    "No tool changes this swatch": "任何工具都不改动此色板",
    "From 1": "从 1 开始",
    "From 1; 0: the one of the nearest learned color": "从 1 开始；0：学习颜色最接近的那个",
    "Set the object's swatches so that its source color becomes the target color; locked ones stay": (
        "设置物体的色板，使源颜色变为目标颜色；锁定的不变"
    ),
    "Give a swatch, or all of an object, the learned color and surface back; locked ones stay": (
        "将一个色板或物体的全部色板恢复为学习到的颜色和表面；锁定的不变"
    ),
    "What can be done to a swatch.": "可对色板进行的操作。",
    "What can be done to an object's palette.": "可对物体的调色板进行的操作。",
    "Other Object": "另一物体",
    "Other Swatch": "另一色板",
    "Link": "链接",
    "Unlink": "取消链接",
    "Link With": "链接到",
    "Give this swatch the other one's color, and let both have one color from now on": (
        "将另一色板的颜色赋予此色板，此后两者保持同一颜色"
    ),
    "Let this swatch move by itself again; its color stays": "让此色板重新单独变化；颜色不变",
    "Swatches with the same number have one color; 0: none": "编号相同的色板保持同一颜色；0：无",
    "Swatches to have one color with.": "可与之保持同一颜色的色板。",
    "Swap": "交换",
    "Swap With": "交换为",
    "Exchange the colors of two swatches": "交换两个色板的颜色",
    "Swatches to exchange colors with.": "可与之交换颜色的色板。",
    "Merge": "合并",
    "Merge Into": "合并到",
    "Into": "到",
    "Let another swatch of the object move this one's paint along with its own; this one is no longer shown": (
        "让物体的另一色板连同此色板的颜料一起变化；此色板不再显示"
    ),
    "Show the swatches again that were merged into this one; each moves by itself, colors stay": (
        "重新显示合并到此色板的各色板；各自单独变化，颜色不变"
    ),
    "Swatches of the object that may move this one too.": "也可带动此色板的同一物体的色板。",
    "The number of the object's swatch that moves this one; 0: none": "带动此色板的物体色板的编号；0：无",
    "Add Color": "添加颜色",
    "Pick a color of the object in the picture: it becomes one more swatch, which changes only what has this pigment": (
        "在图片中拾取物体的一种颜色：它成为又一个色板，只改变具有此颜料的部分"
    ),
    "Picked": "拾取的颜色",
    "A color of the object, as the photos show it": "物体在照片中的一种颜色",
    "Reach": "范围",
    "How far around its hue (of a gray: its chroma) colors of the object are of this pigment": (
        "物体的颜色在其色相（灰色则为彩度）周围多大范围内属于此颜料"
    ),
    "Click on {name} in the picture to add its color there.  Esc: none": (
        "在图片中点击 {name}，添加该处的颜色。  Esc：取消"
    ),
    "Added as swatch {number}: change its color": "已添加为色板 {number}：请更改其颜色",
    "Protect Neutrals": "保护中性色",
    "Gray Card": "灰卡",
    "What a gray card (L* 50, 18 %) looks like in the photos; pick it in the picture (E). Names and numbers of colors are "
    "then those under daylight. Black: no card": (
        "灰卡（L* 50，18 %）在照片中的样子；在图像中拾取（E）。颜色的名称和数值随后是日光下的。黑色：没有灰卡"
    ),
    "Photo Space": "照片空间",
    "Layer Space": "图层空间",
    "Color Config": "色彩配置",
    "Color space that the photos' files are in, by its OpenColorIO name, as ACEScg; recolored photos are written in it. Empty: "
    "sRGB, of OpenEXR linear light. The engine needs its extra color": (
        "照片文件所在的色彩空间，用其 OpenColorIO 名称，如 ACEScg；重新着色的照片以它写出。留空：sRGB，OpenEXR 为线性光。"
        "引擎需要其附加组件 color"
    ),
    "Color space of the layers' picture, by its OpenColorIO name, as ACEScg. Empty: linear Rec. 709. The engine needs its "
    "extra color": "图层图像的色彩空间，用其 OpenColorIO 名称，如 ACEScg。留空：线性 Rec. 709。引擎需要其附加组件 color",
    "OpenColorIO configuration of these spaces, config.ocio. Empty: that of the variable OCIO, else the engine's own": (
        "这些空间的 OpenColorIO 配置 config.ocio。留空：环境变量 OCIO 的配置，否则为引擎自带的配置"
    ),
    "Pick Color Chart": "拾取色卡",
    "Find Color Chart": "查找色卡",
    "Remove Color Chart": "移除色卡",
    "Corners": "角点",
    "Image": "图像",
    "Color chart: {number} left of CIEDE2000": "色卡：剩余 CIEDE2000 {number}",
    "The chart's patches are off by CIEDE2000 {left} in the mean": "色卡的色块平均相差 CIEDE2000 {left}",
    "CIEDE2000 that the chart's patches are off in the mean": "色卡色块的平均 CIEDE2000 差异",
    "From linear light under daylight to that in the photos, by a color chart; zeros: no chart": (
        "由色卡得出的、从日光下的线性光到照片中线性光的变换；全为零：没有色卡"
    ),
    "Click the corners of a color chart (24 patches) in an Image Editor: names of colors are then those under daylight": (
        "在图像编辑器中点击色卡（24 个色块）的四角：颜色的名称随后是日光下的"
    ),
    "Let the engine look for a color chart (24 patches) in the photo that the Image Editor shows: names of colors are then "
    "those under daylight": "让引擎在图像编辑器所显示的照片中查找色卡（24 个色块）：颜色的名称随后是日光下的",
    "No color chart was found in {path}.": "在 {path} 中没有找到色卡。",
    "Click its four corners, or give them in pixels: --corners u,v,u,v,u,v,u,v.": "请点击它的四角，或以像素给出：--corners u,v,u,v,u,v,u,v。",
    "{name} has no file.": "{name} 没有文件。",
    "Save it, or click the corners of the chart.": "请保存它，或点击色卡的四角。",
    "Forget the color chart: names and numbers of colors are what photos show, or those of the gray card": (
        "忘记色卡：颜色的名称和数值是照片所显示的，或灰卡的"
    ),
    "Click the outer corner of the brown patch.  Esc: none": "点击棕色色块的外角。  Esc：取消",
    "Click the outer corner of the bluish green patch, at the end of the brown one's row.  Esc: none": (
        "点击蓝绿色色块的外角，它在棕色那一行的末端。  Esc：取消"
    ),
    "Click the outer corner of the black patch.  Esc: none": "点击黑色色块的外角。  Esc：取消",
    "Click the outer corner of the white patch.  Esc: none": "点击白色色块的外角。  Esc：取消",
    "No Image Editor shows a photo.": "没有图像编辑器显示照片。",
    "Open the photo of the chart in one.": "请在其中打开色卡的照片。",
    "Open the photo of the chart.": "请打开色卡的照片。",
    "{name} shows no picture.": "{name} 没有显示图像。",
    "The card is too dark or too bright there": "灰卡在那里太暗或太亮",
    "Silver, foil, paper and gloss stay as they are: colors whose saturation is under this share of the pigment's are not "
    "of it. 0: its hue alone decides": "银色、箔、纸和光泽保持不变：饱和度低于该颜料此比例的颜色不属于它。0：仅由色相决定",
    "Change this swatch's own pigment alone: letters, bands, a print. Silver, foil, paper and gloss stay as they are": (
        "只改变此色板自己的颜料：文字、条带、印刷。银色、箔、纸和光泽保持不变"
    ),
    "Swatch {number} now changes this pigment": "色板 {number} 现在改变此颜料",
    "Metal": "金属",
    "Highlights take the paint's color, as those of gold or copper do. Of everything else they keep the light's color": (
        "高光取漆料的颜色，如金或铜那样。其他一切的高光保持光的颜色"
    ),
    "Take this added color away: its pigment follows the other swatches again": (
        "移除此添加的颜色：其颜料重新跟随其他色板"
    ),
    "The artist has added this color; its pigment has a set of swatches behind it": (
        "此颜色由艺术家添加；其颜料另有一组色板"
    ),
    "Copy": "复制",
    "Paste": "粘贴",
    "Remove": "移除",
    "Copy Palette": "复制调色板",
    "Paste Palette": "粘贴调色板",
    "Copy a swatch's color, or all of an object, to the clipboard as #rrggbb, for any program": (
        "将一个色板或物体全部色板的颜色以 #rrggbb 复制到剪贴板，供任何程序使用"
    ),
    "Set a swatch, or those of an object in their order, to the colors in the clipboard; locked ones stay": (
        "将一个色板或物体的各色板依次设为剪贴板中的颜色；锁定的不变"
    ),
    "Palette": "调色板",
    "Palette Presets": "调色板预设",
    "Add Palette Preset": "添加调色板预设",
    "Apply Palette Preset": "应用调色板预设",
    "Set the object's swatches in their order to this palette; locked ones stay": "按顺序将物体的色样设为此调色板；锁定的不变",
    "KaRF Swatch": "KaRF 色样",
    "Palettes that were kept, for any object.": "保存的调色板，可用于任何物体。",
    "Keep an object's palette as a preset, for any object of any file, or remove one": (
        "将物体的调色板保存为预设，供任何文件的任何物体使用，或移除预设"
    ),
    "The colors of its swatches, as Copy Palette writes them": "其色板的颜色，格式与“复制调色板”相同",
    "Match a picture": "匹配画面",
    "Match Picture": "匹配画面",
    "Fit the swatches to a painted or graded picture of the view": "使色板贴合此视图的绘制或调色画面",
    "Set the swatches so that the active view looks as this picture of it does; locked ones stay": (
        "设置色板，使当前视图看起来与它的这张画面一致；锁定的不变"
    ),
    "The active view painted over or graded, of any size": "当前视图经过绘制或调色的画面，尺寸不限",
    "The view that was painted over": "被绘制的视图",
    "Paint Over": "在其上绘制",
    "Paint on a copy of the active view in the Image Editor, to match the swatches to it": (
        "在图像编辑器中绘制当前视图的副本，使色板与之匹配"
    ),
    "Paint on the objects in the Image Editor, then press Match Picture": "在图像编辑器中绘制物体，然后按“匹配画面”",
    "Prepare the view first": "请先准备视图",
    "Before": "之前",
    "After": "之后",
    "Mean CIEDE2000 to the picture before the match": "匹配之前与画面的平均 CIEDE2000",
    "Mean CIEDE2000 to the picture after the match": "匹配之后与画面的平均 CIEDE2000",
    "Difference to the picture: {left}": "与画面的差异：{left}",
    "{name}: what is left is {how} ({left}, was {before})": "{name}：剩余差异{how}（{left}，之前 {before}）",
    "Difference: 1 is just visible": "差异：1 为刚可察觉",
    "Advanced": "高级",
    "{count} marked": "已标记 {count}",
    "Brush, lasso and box mark without it.": "画笔、套索和框不需要引擎也能标记。",
    # --- live camera
    "Live Camera": "实时相机",
    "Show what the scene's camera sees in the Image Editor, coarse while it moves, fine when it stands still; swatches "
    "change it at once": "在图像编辑器中显示场景相机所见，移动时粗略，静止时精细；色板变化立即生效",
    "No Image Editor shows the picture KaRF camera, so it is not rendered. Choose it in one.": (
        "没有图像编辑器显示画面“KaRF camera”，因此不渲染它。请在某个图像编辑器中选择它。"
    ),
    "A free camera has no photo: Original is the scene as learned.": "自由相机没有照片：“原图”是学习到的场景。",
    "There are no palettes yet, so the picture is the scene as learned. Extract Palette, step 5.": (
        "还没有调色板，因此画面是学习到的场景。请执行第 5 步的“提取调色板”。"
    ),
    "Nothing is segmented yet, so there are no masks to show. Segment, step 4.": (
        "尚未分割，因此没有可显示的遮罩。请执行第 4 步的“分割”。"
    ),
    "Of the followed camera's picture": "所跟随相机的画面的",
    "The engine is at work": "引擎正在工作",
    "KaRF Wipe": "KaRF 擦拭对比",
    "The line, where the Image Editor shows the picture with a wipe.": "图像编辑器以擦拭方式显示画面时的分界线。",
    "Marking Model": "标记模型",
    "The whole path of a folder with a model of the Segment Anything family, which then answers boxes and clicks; "
    "empty: they need none": "Segment Anything 系列模型所在文件夹的完整路径，由它处理框和点击；留空：不需要模型",
    # --- suggested views and volumes
    "Ctrl: take away": "Ctrl：去除",
    "Ctrl: this is not the object": "Ctrl：这不是该物体",
    "Suggested View": "建议的视图",
    "Mark next: {view}": "下一个标记：{view}",
    "Any view helps about as much": "标记任何视图的帮助都差不多",
    "{name}: {share} % unsure, where marks and colors differ": "{name}：{share} % 不确定，标记与颜色在那里不一致",
    "{name}: {share} % unsure, where no mark shows it": "{name}：{share} % 不确定，没有标记显示那里",
    "Go to the view whose mark would decide most, as the last segmentation found it; again: to the next best": "转到"
    "上次分割认为标记后最有帮助的视图；再按一次：下一个",
    "Volume": "体积",
    "Let the object to mark be inside or outside of the active mesh, or of the active Empty's box, as it stands now": "让"
    "要标记的物体位于活动网格或活动空物体盒子的当前范围之内或之外",
    "The object is nowhere else": "该物体不在别处",
    "The object is not in it": "该物体不在其中",
    "Take all volumes of the object away": "移除该物体的所有体积",
    "Volumes of {name}: {count}. Segment heeds them": "{name} 的体积：{count}。分割时会遵守",
    # --- splats of other programs
    "Across the largest flat parts, or where COLMAP has it": "垂直于最大的平坦部分，或按 COLMAP 的方向",
    "Add each Gaussian's object, probability and palette weights to a .ply": (
        "在 .ply 中加入每个高斯的物体、概率和调色板权重"
    ),
    "Antialiased": "抗锯齿",
    "As Blender shows it, turned as most viewers of splats expect a .ply": (
        "与 Blender 中显示的一致，并转为多数泼溅查看器对 .ply 的朝向"
    ),
    "As Imported": "与导入时相同",
    "As splats were imported; of a scene that was learned here, as Blender shows it": (
        "与导入的泼溅相同；在此学习的场景则与 Blender 中显示的一致"
    ),
    "Attributes": "属性",
    "Axes": "坐标轴",
    "Cameras": "相机",
    "Capture that it was learned from, with the same poses; empty: views are rendered around the splats": (
        "学习它所用的拍摄，位姿相同；留空：在泼溅四周渲染视图"
    ),
    "Cut out this object; empty: the whole scene": "只取出此物体；留空：整个场景",
    "Export Splat": "导出泼溅",
    "Gaussian Splat (KaRF)": "高斯泼溅 (KaRF)",
    "Import Gaussian splats that another program has learned, to mark and recolor objects in them": (
        "导入其他程序学习的高斯泼溅，以便在其中标记物体并重新着色"
    ),
    "Import Splat": "导入泼溅",
    "KaRF splat": "KaRF 泼溅",
    "Leave out the shell that shows what is behind the scene": "不包含显示场景背后内容的外壳",
    "Splats may be dropped on the 3D View; a .ply that holds none is refused with a sentence when it is read.": (
        "泼溅可以拖放到 3D 视图上；不含泼溅的 .ply 会在读取时被拒绝并说明原因。"
    ),
    "The capture's own world": "拍摄自身的世界坐标",
    "They were learned with antialiasing (Mip-Splatting), and the file does not say so": (
        "学习时使用了抗锯齿 (Mip-Splatting)，而文件没有说明"
    ),
    "Up": "上方",
    "Where and as large as Blender shows it; kinds of files that say what is up get it": (
        "位置和大小与 Blender 中显示的一致；规定了上方的文件类型按其规定"
    ),
    "Without Background": "不含背景",
    "Without photos: a transforms.json of exported cameras, whose views come first": (
        "没有照片时：已导出相机的 transforms.json，其视图排在最前"
    ),
    "Without photos: how many are rendered": "没有照片时：渲染多少个视图",
    "Without photos: which axis of the file points up": "没有照片时：文件的哪个轴指向上方",
    "Write the scene as Gaussian splats with the swatches as they stand: PLY, SPZ, glTF or USD, by the file's ending": (
        "按当前色板将场景写成高斯泼溅：按文件扩展名为 PLY、SPZ、glTF 或 USD"
    ),
    "Y Down": "Y 轴向下",
    "Z Up": "Z 轴向上",
    "Choke": "收边",
    "Edge": "边缘",
    "Feather": "羽化",
    "How far inside its edge the object's paint ends, in pixels of the photo; below 0 it goes beyond": (
        "物体的着色在其边缘以内多远处结束，以照片像素计；小于 0 时超出边缘"
    ),
    "Over how many pixels of the photo the paint fades, half of them on either side of its edge": (
        "着色在照片的多少个像素内淡出，边缘两侧各占一半"
    ),
    "Where the object's paint ends, and how softly": "物体的着色在何处结束，以及多柔和",
    # --- colors by name
    "A swatch's color in numbers, and the names of the color book next to it": "色板颜色的数值，以及色卡中与它最接近的名称",
    "Choose a book of named colors: Adobe's .acb or .ase, GIMP's .gpl, or a .csv table. It is kept in the preferences": "选择一本有名称的色卡：Adobe 的 .acb 或 .ase、GIMP 的 .gpl，或 .csv 表格。它保存在偏好设置中",
    "Color Book": "色卡",
    "Find Color Name": "查找颜色名称",
    "From 1; 0: the target color": "从 1 开始；0：目标颜色",
    "Numbers and Names": "数值与名称",
    "Numbers and Names of the Target": "目标的数值与名称",
    "Search the color book, and take the color of a name": "搜索色卡，并采用某个名称的颜色",
    "Take the color of this name": "采用此名称的颜色",
    "The whole path of a book of named colors: Adobe's .acb or .ase, GIMP's .gpl, or a .csv table. The menu of a swatch shows the names that are nearest to it": "有名称的色卡的完整路径：Adobe 的 .acb 或 .ase、GIMP 的 .gpl，或 .csv 表格。色板的菜单会显示与它最接近的名称",
    "Use Color Name": "采用颜色名称",
    "What the left color becomes in numbers, and the names of the color book next to it": "左侧颜色将变成的颜色的数值，以及色卡中与它最接近的名称",
    "{book}: {count} names": "{book}：{count} 个名称",
    "{name}: {how} ({number})": "{name}：{how}（{number}）",
    "No picture can show {name}: the nearest color differs from it by CIEDE2000 {left}": "没有图像能显示 {name}：最接近的颜色与它相差 CIEDE2000 {left}",
    "Choose Look": "选用造型",
    "Flip Looks": "切换造型",
    "Flip back to the look that was in use before, and forth again": "切换回之前使用的造型，再按一次切换回来",
    "Give this look another name": "给此造型另一个名称",
    "Keep Look": "保存造型",
    "Keep Swatches Here": "将色板存入此造型",
    "Keep a look first": "请先保存一个造型",
    "Keep all swatches as they stand as a look of this file, or in the place of one, to come back to them by a click": "将全部色板的现状存为此文件的造型（或替换一个造型），以便一键恢复",
    "Keep two looks to flip between them": "保存两个造型即可在其间切换",
    "Look": "造型",
    "Move Look": "移动造型",
    "Move this look in the list": "在列表中移动此造型",
    "Places down the list": "在列表中向下的位数",
    "Recolor views by each look that was kept, a folder for each": "按每个已保存的造型为视图重新着色，每个造型一个文件夹",
    "Remove Look": "移除造型",
    "Remove this look; swatches stay as they are": "移除此造型；色板保持不变",
    "Rename": "重命名",
    "Rename Look": "重命名造型",
    "Render": "渲染",
    "Render Looks": "渲染造型",
    "Set all swatches to this look, locked ones too": "将全部色板（包括锁定的）设为此造型",
    "The JSON of edit.json": "edit.json 的 JSON 内容",
    "The look in use; empty: none": "正在使用的造型；空：无",
    "The look that was in use before, to flip back to": "之前使用的造型，可切换回去",
    "The photos, each recolored by every look": "照片，每张按每个造型重新着色",
    "The swatches are kept as look {name}": "色板已存为造型 {name}",
    "What can be done to a look.": "可对造型进行的操作。",
    "What the scene's camera sees in the scene's frames, by every look": "场景相机在场景各帧中所见，按每个造型",
    "{name} had changed since it was kept: undo brings that back": "{name} 保存后有改动：撤销可恢复这些改动",
    # --- the manual, and where steps and files are
    "Colorways and Looks": "配色方案与造型",
    "Composite": "合成",
    "From and to other programs": "与其他程序之间的导入和导出",
    "From photos to a learned scene": "从照片到学习好的场景",
    "Image Editor": "图像编辑器",
    "Import and Learn": "导入与学习",
    "Many variants": "许多变体",
    "Mark": "标记",
    "Nodes that recolor without the extension": "不需要此扩展即可重新着色的节点",
    "Open Manual": "打开手册",
    "Page": "页面",
    "Read in a Text Editor how this is done, and what each control does": "在文本编辑器中阅读操作方法以及每个控件的作用",
    "Recolor": "重新着色",
    "Recolored photos, and what other cameras see": "重新着色的照片，以及其他相机所见",
    "Show in 3D": "在 3D 中显示",
    "Splats": "泼溅",
    "Swatches, and all that changes a color": "色板，以及改变颜色的一切",
    "The scene as an object": "场景作为物体",
    "Where files were written last": "上次写入文件的位置",
    "Where the masks are wrong": "遮罩有误之处",
    "Where the objects are in a few photos": "物体在几张照片中的位置",
    "Written": "已写入",
}
