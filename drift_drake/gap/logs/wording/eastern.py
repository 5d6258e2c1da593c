"""Words of columns' names in Japanese, Chinese and Korean, in the English words that `vocabulary` knows."""

import re
import unicodedata

TERMS = {
    "yaw rate": "ヨーレート ヨーレイト 横摆率 偏航率 요레이트 요율 요속도",
    "yaw": "ヨー 横摆 橫擺 偏航 요",
    "yaw angle": "ヨー角 横摆角 橫擺角 偏航角 요각",
    "heading": "方位角 方位 航向角 航向 방위각 방위 헤딩",
    "speed": "車両速度 車速 速度 车辆速度 车速 차량속도 차속 속도 速",
    "steer angle": "操舵角 舵角 転舵角 ステアリング角 ステア角 转向角 前轮转角 轉向角 조향각",
    "steer": "ステアリング 操舵 转向 조향 스티어링",
    "handwheel angle": "ハンドル角 方向盘转角 方向盘角度 方向盘角 方向盤轉角 핸들각 핸들각도 조향휠각",
    "handwheel": "ハンドル 方向盘 方向盤 핸들",
    "road wheel angle": "実舵角 タイヤ角 车轮转角",
    "acc": "加速度 가속도",
    "acc lat": "横加速度 侧向加速度 横向加速度 橫向加速度 側向加速度 횡가속도",
    "acc long": "前後加速度 纵向加速度 縱向加速度 종가속도",
    "acc z": "上下加速度 垂向加速度 수직가속도",
    "lat": "横 横向 侧向 側向 횡",
    "long": "前後 纵向 縱向 종",
    "slip angle": "横滑り角 スリップ角 質心側偏角 质心侧偏角 侧偏角 側偏角 횡슬립각",
    "angular speed": "角速度 각속도",
    "angular acc": "角加速度 각가속도",
    "angle": "角度 角 각도 각",
    "rate": "レート 率",
    "torque": "トルク 扭矩 转矩 轉矩 토크",
    "engine": "エンジン モーター モータ 发动机 發動機 电机 电动机 엔진 모터",
    "revs": "回転数 回転速度 转速 轉速 회전수",
    "wheel": "車輪 轮 车轮 輪 휠 바퀴",
    "rear": "後 后 후",
    "front": "前 전",
    "right": "右 우",
    "left": "左 좌",
    "latitude": "緯度 纬度 위도",
    "longitude": "経度 经度 經度 경도",
    "time": "経過時間 時間 時刻 时间 时刻 시간 시각",
    "target": "目標 指令 要求 目标 期望 设定 設定 목표 명령 요구",
    "roll": "ロール 侧倾 側傾 롤",
    "pitch": "ピッチ 俯仰 피치",
    "throttle": "アクセル開度 アクセル スロットル 油门 節気門 节气门 加速踏板 가속페달 스로틀 액셀",
    "brake": "ブレーキ 制動 制动 刹车 制動圧 브레이크 제동",
    "limit": "制限 限 제한",
    "pressure": "圧力 圧 压力 压 압력",
    "temperature": "温度 水温 油温 온도",
    "distance": "距離 距离 거리",
    "altitude": "高度 标高 標高 고도",
    "wind": "風 风 풍",
    "beta": "β",
    "delta": "δ",
    "psi": "ψ",
}
ENGLISH = {term: words for words, terms in TERMS.items() for term in terms.split()} | {
    "車輪速": "wheel speed", "車輪速度": "wheel speed", "轮速": "wheel speed", "輪速": "wheel speed",
    "바퀴속도": "wheel speed", "휠속도": "wheel speed", "風速": "wind speed", "风速": "wind speed", "풍속": "wind",
    "後輪": "rear wheel", "后轮": "rear wheel", "후륜": "rear wheel", "前輪": "front wheel", "前轮": "front wheel",
    "전륜": "front wheel", "后轮转速": "rear wheel revs", "車輪回転数": "wheel revs", "횡g": "lat g", "横g": "lat g",
    "前後g": "long g", "ψ\u0307": "yaw rate",
}  # fmt: skip
TERM = re.compile("|".join(map(re.escape, sorted(ENGLISH, key=len, reverse=True))), re.IGNORECASE)
SURE = re.compile("|".join(map(re.escape, [term for term in ENGLISH if len(term) > 1 and not term.isascii()])))


def in_english(name: str) -> str:
    """The name with the words that are known in English, between blanks."""
    if name.isascii():
        return name
    return TERM.sub(lambda found: f" {ENGLISH[found[0].lower()]} ", unicodedata.normalize("NFKC", name))
